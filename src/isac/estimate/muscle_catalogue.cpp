#include "isac/estimate/muscle_catalogue.hpp"

#include <ceres/jet.h>

#include <cstddef>

#include "isac/models/muscle_empirical.hpp"
#include "isac/models/muscle_geometry.hpp"

namespace isac::estimate {
namespace {

// Scaled parameters: 1e-3 N/Pa is 100 N at 1 bar, the size of a 10 mm muscle.
constexpr double kForcePerPascal = 1e-3, kForce = 100, kBar = 1e5;

struct Schulte {
  static constexpr int kParameters = 2;
  template <class T>
  static T force(const T* x, const T&, const T& p, const T& e, const T& v) {
    return models::force(models::SchulteMuscle<T>{.diameter = x[0] * T(0.01), .rest_angle = x[1]}, p, e, v);
  }
};

struct Bridgestone {
  static constexpr int kParameters = 2;
  template <class T>
  static T force(const T* x, const T& d, const T& p, const T& e, const T& v) {
    return models::force(
        models::BridgestoneMuscle<T>{.diameter = d, .a = x[0] * T(10.0), .b = x[1] * T(10.0)}, p, e, v);
  }
};

struct ThinWall {  // thread length and turns enter by their quotient only
  static constexpr int kParameters = 2;
  template <class T>
  static T force(const T* x, const T&, const T& p, const T& e, const T& v) {
    return models::force(
        models::ThinWallMuscle<T>{.thread_length = x[0] * T(0.03), .turns = T(1.0), .rest_angle = x[1]}, p, e,
        v);
  }
};

struct ThickWall {
  static constexpr int kParameters = 3;
  template <class T>
  static T force(const T* x, const T&, const T& p, const T& e, const T& v) {
    return models::force(
        models::ThickWallMuscle<T>{
            .thread_length = x[0] * T(0.03), .turns = T(1.0), .rest_angle = x[1], .wall = x[2] * T(1e-3)},
        p, e, v);
  }
};

struct CaiYamaura {
  static constexpr int kParameters = 4;
  template <class T>
  static T force(const T* x, const T&, const T& p, const T& e, const T& v) {
    return models::force(models::CaiYamauraMuscle<T>{.alpha = x[0] * T(kForcePerPascal),
                                                     .beta = x[1] * T(kForcePerPascal),
                                                     .gamma = x[2] * T(kForce),
                                                     .omega = x[3] * T(kForce)},
                         p, e, v);
  }
};

struct Kerscher {
  static constexpr int kParameters = 5;
  template <class T>
  static T force(const T* x, const T& d, const T& p, const T& e, const T& v) {
    return models::force(models::KerscherMuscle<T>{.radius = d / T(2.0),
                                                   .a = x[0] * T(10.0),
                                                   .b = x[1] * T(10.0),
                                                   .a_epsilon = x[2] * T(10.0),
                                                   .b_epsilon = T(-1.0),
                                                   .stretch_stiffness = x[4] * T(1e3),
                                                   .pressure_unit = x[3] * T(kBar)},
                         p, e, v);
  }
};

template <class T>
models::PolynomialMuscle<T> polynomial(const T* x, int terms) {
  // Coefficients of ε^j are scaled by 10^j: the fit sees ε in tenths.
  constexpr double kScale[10] = {1, 1, 10, 1, 10, 100, 1, 10, 100, 1000};
  models::PolynomialMuscle<T> m;
  for (int k = 0; k < terms; ++k) m.c[k] = x[k] * T(kForce * kScale[k]);
  return m;
}

struct Quadratic {
  static constexpr int kParameters = 6;
  template <class T>
  static T force(const T* x, const T&, const T& p, const T& e, const T& v) {
    return models::force(polynomial(x, kParameters), p, e, v);
  }
};

struct Cubic {
  static constexpr int kParameters = 10;
  template <class T>
  static T force(const T* x, const T&, const T& p, const T& e, const T& v) {
    return models::force(polynomial(x, kParameters), p, e, v);
  }
};

struct SecondOrder {
  static constexpr int kParameters = 6;
  template <class T>
  static T force(const T* x, const T&, const T& p, const T& e, const T& v) {
    return models::force(
        models::SecondOrderMuscle<T>{.force_0 = x[0] * T(kForce),
                                     .force_per_pressure = x[1] * T(kForcePerPascal),
                                     .stiffness_0 = x[2] * T(10 * kForce),
                                     .stiffness_per_pressure = x[3] * T(10 * kForcePerPascal),
                                     .damping_0 = x[4] * T(kForce),
                                     .damping_per_pressure = x[5] * T(kForcePerPascal)},
        p, e, v);
  }
};

template <class Model>
double evaluate(const double* x, double diameter, double pressure, double contraction, double rate,
                double* gradient) {
  if (!gradient) return Model::template force<double>(x, diameter, pressure, contraction, rate);
  using Jet = ceres::Jet<double, Model::kParameters>;
  Jet jets[Model::kParameters];
  for (int k = 0; k < Model::kParameters; ++k) jets[k] = Jet(x[k], k);
  const Jet f = Model::template force<Jet>(jets, Jet(diameter), Jet(pressure), Jet(contraction), Jet(rate));
  for (int k = 0; k < Model::kParameters; ++k) gradient[k] = f.v[k];
  return f.a;
}

std::vector<MuscleParameter> polynomial_parameters(int terms) {
  const char* names[] = {"c_1", "c_p", "c_e", "c_pp", "c_pe", "c_ee", "c_ppp", "c_ppe", "c_pee", "c_eee"};
  const char* units[] = {"N", "N/bar", "N", "N/bar2", "N/bar", "N", "N/bar3", "N/bar2", "N/bar", "N"};
  const double factors[] = {1e2, 1e2, 1e3, 1e2, 1e3, 1e4, 1e2, 1e3, 1e4, 1e5};
  const double starts[] = {-0.5, 0.6, -1.0, 0.01, -0.1, 0.1, 0.0, 0.0, 0.0, 0.0};
  std::vector<MuscleParameter> out;
  for (int k = 0; k < terms; ++k) out.push_back({names[k], units[k], starts[k], factors[k]});
  return out;
}

}  // namespace

std::span<const MuscleModelEntry> muscle_catalogue() {
  static const std::vector<MuscleModelEntry> entries = {
      {"schulte",
       "M1 Schulte",
       "pi D0^2 p/4 (3 cos^2 T - 1), cos T = (1 - e) cos T0",
       {{"D0", "m", 1.8, 0.01}, {"theta0", "rad", 0.45, 1}},
       nullptr,
       nullptr,
       evaluate<Schulte>},
      {"bridgestone",
       "M2 Bridgestone",
       "D0^2 p (a (1 - e)^2 - b)",
       {{"a", "-", 1.8, 10}, {"b", "-", 1.2, 10}},
       nullptr,
       nullptr,
       evaluate<Bridgestone>},
      {"chou_hannaford_thin",
       "M3 Chou-Hannaford, thin wall",
       "(b/n)^2 p (3 cos^2 T - 1)/(4 pi)",
       {{"b_per_n", "m", 1.8, 0.03}, {"theta0", "rad", 0.45, 1}},
       nullptr,
       nullptr,
       evaluate<ThinWall>},
      {"chou_hannaford_thick",
       "M3 Chou-Hannaford, thick wall",
       "thin + p pi (D0 d (2 sin T - 1/sin T) - d^2)",
       {{"b_per_n", "m", 1.8, 0.03}, {"theta0", "rad", 0.45, 1}, {"wall", "mm", 0.5, 1}},
       nullptr,
       nullptr,
       evaluate<ThickWall>},
      {"cai_yamaura",
       "M4 Cai-Yamaura",
       "alpha (1 - e)^2 p + beta p - omega e' + gamma",
       {{"alpha", "N/Pa", 1.8, 1e-3},
        {"beta", "N/Pa", -1.2, 1e-3},
        {"gamma", "N", -0.2, 100},
        {"omega", "N s", 0, 100}},
       "omega",
       nullptr,
       evaluate<CaiYamaura>},
      {"kerscher",
       "M5 Kerscher",
       "pi r0^2 p (a (1 - eps(p) e)^2 - b), eps(p) = a_eps exp(-p/p_e) + 1",
       {{"a", "-", 1.0, 10},
        {"b", "-", 0.3, 10},
        {"a_eps", "-", 1.0, 10},
        {"p_e", "bar", 3.0, 1},
        {"f0", "N", 0, 1000}},
       nullptr,
       "f0",
       evaluate<Kerscher>},
      {"polynomial", "M6 polynomial, second degree", "sum c_ij p^i e^j, i + j <= 2", polynomial_parameters(6),
       nullptr, nullptr, evaluate<Quadratic>},
      {"polynomial_cubic", "M6 polynomial, third degree", "sum c_ij p^i e^j, i + j <= 3",
       polynomial_parameters(10), nullptr, nullptr, evaluate<Cubic>},
      {"second_order",
       "M6 second-order black box",
       "F0 + F1 p - (K0 + K1 p) e - (B0 + B1 p) e'",
       {{"F0", "N", -0.5, 100},
        {"F1", "N/Pa", 0.6, 1e-3},
        {"K0", "N", 0.5, 1000},
        {"K1", "N/Pa", 0.1, 1e-2},
        {"B0", "N s", 0, 100},
        {"B1", "N s/Pa", 0, 1e-3}},
       "B0,B1",
       nullptr,
       evaluate<SecondOrder>},
  };
  return entries;
}

}  // namespace isac::estimate
