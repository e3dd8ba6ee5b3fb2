// What kinematics, gravity and inertia of the six-joint arm cost on this machine, in double and in float.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <random>
#include <vector>

#include "isac/control/compensation.hpp"
#include "isac/models/arm/soft_arm.hpp"

namespace {

using namespace isac;

template <class S>
struct Arm {
  models::SoftArmGeometry<S> geometry{};
  models::Chain<S, 6> chain = models::soft_arm_chain(geometry);
  models::Coupling<S, 6> coupling = models::soft_arm_coupling<S>();
  models::Coupling<S, 6> inverse{};
  models::JointLimits<S> limits{};
  std::vector<models::JointVector<S, 6>> poses;
  std::vector<models::Transform<S>> wrists;

  Arm() {
    if (!ok(models::inverse_coupling<S, 6>(coupling, inverse))) std::abort();
    limits.lower.fill(S(-3.1));
    limits.upper.fill(S(3.1));
    std::mt19937 random(1);
    std::uniform_real_distribution<double> angle(-1.2, 1.2);
    poses.resize(1024);
    for (auto& pose : poses) {
      for (S& a : pose) a = S(angle(random));
      wrists.push_back(models::chain_frames(chain, pose)[5]);
    }
  }
};

/// `body` of pose after pose.
template <class S, class Body>
void over_poses(benchmark::State& state, Body body) {
  const Arm<S> arm;
  std::size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(body(arm, k));
    k = k + 1 == arm.poses.size() ? 0 : k + 1;
  }
}

template <class S>
void place_of_the_hand(benchmark::State& state) {
  over_poses<S>(
      state, [](const Arm<S>& arm, std::size_t k) { return models::tool_position(arm.chain, arm.poses[k]); });
}
template <class S>
void inverse_kinematics_all_solutions(benchmark::State& state) {
  over_poses<S>(state, [](const Arm<S>& arm, std::size_t k) {
    return models::soft_arm_inverse(arm.geometry, arm.wrists[k], arm.poses[k]);
  });
}
template <class S>
void inverse_kinematics_nearest(benchmark::State& state) {
  over_poses<S>(state, [](const Arm<S>& arm, std::size_t k) {
    const auto found = models::soft_arm_inverse(arm.geometry, arm.wrists[k], arm.poses[k]);
    return models::nearest_solution(found, arm.poses[k], arm.inverse, arm.limits);
  });
}
template <class S>
void gravity(benchmark::State& state) {
  over_poses<S>(state, [](const Arm<S>& arm, std::size_t k) {
    return control::compensation_torque<S, 6>(arm.chain, arm.coupling, arm.poses[k], {},
                                              control::InertiaShare::kNone);
  });
}
template <class S>
void gravity_and_inertia_of_joint_one(benchmark::State& state) {
  over_poses<S>(state, [](const Arm<S>& arm, std::size_t k) {
    return control::compensation_torque<S, 6>(arm.chain, arm.coupling, arm.poses[k], arm.poses[k],
                                              control::InertiaShare::kFirstJoint);
  });
}

BENCHMARK(place_of_the_hand<double>);
BENCHMARK(place_of_the_hand<float>);
BENCHMARK(inverse_kinematics_all_solutions<double>);
BENCHMARK(inverse_kinematics_all_solutions<float>);
BENCHMARK(inverse_kinematics_nearest<double>);
BENCHMARK(inverse_kinematics_nearest<float>);
BENCHMARK(gravity<double>);
BENCHMARK(gravity<float>);
BENCHMARK(gravity_and_inertia_of_joint_one<double>);
BENCHMARK(gravity_and_inertia_of_joint_one<float>);

}  // namespace

BENCHMARK_MAIN();
