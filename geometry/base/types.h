#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <span>

/// The numbers and vectors everything is written in. SI units, right-handed, z up.
namespace effuse {

using Real = double;
using Index = std::uint32_t;
using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Quat = Eigen::Quaterniond;
using Box3 = Eigen::AlignedBox3d;

inline constexpr Real kPi = 3.14159265358979323846;
inline constexpr Real kGravity = 9.81;              ///< [m/s^2]
inline constexpr Real kStefanBoltzmann = 5.670e-8;  ///< [W/m^2/K^4]
inline constexpr Real kZeroCelsius = 273.15;        ///< [K]

}  // namespace effuse
