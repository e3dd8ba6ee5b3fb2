/// @file
/// Rigid transforms of a serial arm: three-vectors, rotation and position, and the Denavit-Hartenberg step.
///
///   (i−1)_T_i = | cθ       −sθ       0    a      |      mask 4.9 of the seed; α and a belong to link i−1, d
///   and θ to i
///               | sθ cα     cθ cα   −sα  −sα d   |
///               | sθ sα     cθ sα    cα   cα d   |
///
/// Units: metres, radians. Real time: fixed size, no heap, no lock, noexcept; templated on the scalar
/// (double, float, Jet). Errors: none; NaN in, NaN out. Source: seed 4.8, 4.9 (Craig's modified convention).
#pragma once

#include <cmath>

namespace isac::models {

template <class S>
struct Vec3 {
  S x{0}, y{0}, z{0};

  friend constexpr Vec3 operator+(const Vec3& a, const Vec3& b) noexcept {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  friend constexpr Vec3 operator-(const Vec3& a, const Vec3& b) noexcept {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  friend constexpr Vec3 operator*(const S& k, const Vec3& a) noexcept { return {k * a.x, k * a.y, k * a.z}; }
};

template <class S>
[[nodiscard]] constexpr S dot(const Vec3<S>& a, const Vec3<S>& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class S>
[[nodiscard]] constexpr Vec3<S> cross(const Vec3<S>& a, const Vec3<S>& b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Rotation (rows) and position of a frame, seen from its parent.
template <class S>
struct Transform {
  S r[3][3] = {{S(1), S(0), S(0)}, {S(0), S(1), S(0)}, {S(0), S(0), S(1)}};
  Vec3<S> p;

  /// The frame's z axis in the parent's coordinates: the axis of its joint.
  [[nodiscard]] constexpr Vec3<S> z_axis() const noexcept { return {r[0][2], r[1][2], r[2][2]}; }

  /// A point given in this frame, seen from the parent.
  [[nodiscard]] constexpr Vec3<S> apply(const Vec3<S>& q) const noexcept {
    return {r[0][0] * q.x + r[0][1] * q.y + r[0][2] * q.z + p.x,
            r[1][0] * q.x + r[1][1] * q.y + r[1][2] * q.z + p.y,
            r[2][0] * q.x + r[2][1] * q.y + r[2][2] * q.z + p.z};
  }

  friend constexpr Transform operator*(const Transform& a, const Transform& b) noexcept {
    Transform c;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        c.r[i][j] = a.r[i][0] * b.r[0][j] + a.r[i][1] * b.r[1][j] + a.r[i][2] * b.r[2][j];
      }
    }
    c.p = a.apply(b.p);
    return c;
  }
};

/// Fixed part of one Denavit-Hartenberg step: α(i−1), a(i−1), d(i), and an angle added to the joint's own.
template <class S>
struct DhLink {
  S alpha{0}, a{0}, d{0}, theta_offset{0};
};

template <class S>
[[nodiscard]] Transform<S> dh_transform(const DhLink<S>& link, const S& theta) noexcept {
  using std::cos;
  using std::sin;
  const S angle = theta + link.theta_offset;
  const S ct = cos(angle), st = sin(angle), ca = cos(link.alpha), sa = sin(link.alpha);
  Transform<S> t;
  t.r[0][0] = ct;
  t.r[0][1] = -st;
  t.r[0][2] = S(0);
  t.r[1][0] = st * ca;
  t.r[1][1] = ct * ca;
  t.r[1][2] = -sa;
  t.r[2][0] = st * sa;
  t.r[2][1] = ct * sa;
  t.r[2][2] = ca;
  t.p = {link.a, -sa * link.d, ca * link.d};
  return t;
}

}  // namespace isac::models
