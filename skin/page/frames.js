// The run's frames, unpacked when they are wanted and a little before; those seen last stay on the graphics card.

const kKeptBytes = 192e6, kKeptMeshes = 8, kAhead = 3;

class Frames {
  constructor(page, meshes, renderer) {
    Object.assign(this, { page, meshes, renderer });
    this.kept = new Map();    // blob -> GpuMesh, the one used longest ago first
    this.coming = new Map();  // blob -> promise
    this.last = null;         // the scene that was asked for last: it may be on the screen
    this.wanted = [];         // the blobs of the one that is being asked for
    this.bytes = 0;
  }

  blob(id) {
    if (id === null || id === undefined) return null;
    const mesh = this.kept.get(id);
    if (mesh) {
      this.kept.delete(id);
      this.kept.set(id, mesh);
      return mesh;
    }
    if (!this.coming.has(id)) {
      this.coming.set(id, loadMesh(id, this.meshes[id]).then((unpacked) => {
        const uploaded = this.renderer.upload(unpacked);
        this.coming.delete(id);
        this.kept.set(id, uploaded);
        this.bytes += uploaded.bytes;
        this.drop();
        return uploaded;
      }));
    }
    return this.coming.get(id);
  }

  drop() {
    const stay = new Set(this.last ? Object.values(this.last) : []);
    for (const [id, mesh] of this.kept) {
      if (this.bytes <= kKeptBytes || this.kept.size <= kKeptMeshes) return;
      if (stay.has(mesh) || this.wanted.includes(id)) continue;
      this.kept.delete(id);
      this.bytes -= mesh.bytes;
      mesh.free();
    }
  }

  /// What to draw of frame i: { terrain, base, others, lava }; its meshes stay until the next is asked for.
  async scene(i) {
    const frame = this.page.frames[i];
    this.wanted = [this.page.terrain, this.page.base, frame.others, frame.lava];
    const [terrain, base, others, lava] = await Promise.all(this.wanted.map((id) => this.blob(id)));
    return (this.last = { terrain, base, others, lava });
  }

  /// Starts on the frames that come next, while there is room for them.
  prefetch(i, direction) {
    if (this.bytes > kKeptBytes && this.kept.size <= kKeptMeshes) return;
    for (let k = 1; k <= kAhead; ++k) {
      const frame = this.page.frames[i + k * direction];
      if (!frame) return;
      for (const id of [frame.others, frame.lava]) if (id !== null && !this.kept.has(id)) Promise.resolve(this.blob(id)).catch(() => {});
    }
  }
}
