#pragma once

namespace effuse::flow::sph {

/// What keeps a solver stable. For tests, which switch one off to see what it holds off; nothing else does.
struct Guards {
  bool step_limit = true;           ///< steps as short as speeds and accelerations ask, and retried where they go bad
  bool projection = true;           ///< particles are put out of ground and obstacles
  bool implicit_viscosity = true;   ///< instead of the old velocities' forces
  bool make_room = true;            ///< where there is too much of it
  bool monotone_conduction = true;  ///< as many stages as a step needs for no temperature to leave the range of its neighbours
};

}  // namespace effuse::flow::sph
