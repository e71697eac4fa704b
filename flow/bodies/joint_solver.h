#pragma once

#include <Eigen/SparseCholesky>
#include <array>
#include <span>
#include <vector>

#include "flow/bodies/joint.h"
#include "flow/bodies/solver_body.h"

namespace effuse::flow::bodies {

/// A joint as the solver holds it: frames in body axes that stood together when it was made, axis along their x.
struct JointState {
  Joint joint;
  bool broken = false;
  Vec3 anchor_a = Vec3::Zero(), anchor_b = Vec3::Zero();           ///< in body axes
  Quat frame_a = Quat::Identity(), frame_b = Quat::Identity();     ///< body_from_joint
  Real rest = 0;                                                    ///< length of a distance joint when made
  /// Impulses of the last substep: six of what holds, then motor or spring, low and high limit.
  static constexpr int kHolding = 6, kExtras = 3;
  std::array<Real, kHolding + kExtras> impulse{};
};

/// Checks the joint (throws InputError) and finds its frames. Bodies where they are now.
JointState make_joint_state(const Joint& joint, const SolverBody& a, const SolverBody& b);

/// How far it has gone: turn, travel, length or tilt (see RigidBodies::joint_position); and how far it is off.
Real joint_position(const JointState& joint, const SolverBody& a, const SolverBody& b);
Real joint_error(const JointState& joint, const SolverBody& a, const SolverBody& b);

/// The joints of one island. What holds is solved for all together and exactly,
///   (J M^-1 J^T) lambda = -J v - C / h,
/// by a sparse LDL^T whose pattern is the linkage's: no fill for chains and trees, so the cost grows with their length
/// and no mass ratio or length of chain makes it slow to converge. A share of 1e-9 on the diagonal lets loops hold more than they
/// must. Limits, motors and springs, which may give, are solved in turn, as contacts are.
/// Source: Baraff 1996, SIGGRAPH, Linear-time dynamics using Lagrange multipliers.
class JointSolver {
 public:
  /// bodies: by body number, what nothing moves last.
  JointSolver(Real h, std::span<const JointId> which, std::span<JointState> joints, std::span<SolverBody> bodies);

  void prepare(int k);
  void warm_start();
  void solve_extras(bool push);
  void solve_holding(bool push);
  /// After bodies went on to where they are after substep k: how far joints are off there (largest number of C), and, when that is
  /// more than `tolerance`, the impulses at the old place that would have led there (SHAKE: Newton's step with the matrix at hand);
  /// the bodies must then go on anew from where they were.
  Real refine(int k, Real tolerance);
  bool empty() const { return which_.empty(); }
  bool gives() const { return !extras_.empty(); }  ///< has limits, motors or springs (after prepare)

 private:
  /// J v = l . (vb - va) + on_b . wb - on_a . wa; an impulse lambda pushes b by l lambda.
  struct Row {
    Vec3 l, on_a, on_b;
    Real error = 0;
  };
  struct Extra {
    Index joint;
    int slot;                // in impulse, from kHolding
    Index a, b;
    Row row;
    Real low, high;          // of the impulse
    Real mass = 0, target = 0, bias = 0, soft = 0;
    bool limit = false;
  };
  /// Rows of one joint among all, and what of J M^-1 J^T it shares with one before it.
  struct Block {
    Index joint, a, b;
    int first, count;
  };
  struct Meeting {
    Index i, j;  // blocks, i >= j
    std::vector<int> place;  // of each number in the matrix's values
  };
  Real rate(const Row& r, const SolverBody& A, const SolverBody& B) const {
    return r.l.dot(B.v - A.v) + r.on_b.dot(B.w) - r.on_a.dot(A.w);
  }
  void push(const Row& r, Index a, Index b, Real impulse) {
    bodies_[a].push_with(-impulse * r.l, -impulse * r.on_a);
    bodies_[b].push_with(impulse * r.l, impulse * r.on_b);
  }
  void make_rows(const JointState& j, const SolverBody& A, const SolverBody& B, int k, Row* rows) const;
  void make_extras(Index joint, int k);
  void fill();
  /// Among bodies_: the world is the last.
  Index index(BodyId id) const { return id == Joint::kWorld ? static_cast<Index>(bodies_.size() - 1) : id; }

  Real h_;
  std::vector<JointId> which_;
  std::span<JointState> joints_;
  std::span<SolverBody> bodies_;
  std::vector<Block> blocks_;
  std::vector<Row> rows_, ahead_;
  std::vector<Extra> extras_;
  std::vector<Meeting> meetings_;
  Eigen::SparseMatrix<Real> A_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<Real>> ldlt_;
  Eigen::VectorXd lambda_, rhs_;
};

}  // namespace effuse::flow::bodies
