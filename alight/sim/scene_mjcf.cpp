#include <cmath>
#include <locale>
#include <sstream>

#include "alight/sim/rotors.h"
#include "alight/sim/scene.h"

namespace alight {
namespace {

constexpr double kFootRadius = 0.006;
constexpr double kPadThickness = 0.02;
constexpr double kChassisBelow = 0.04;  // under the pad's surface

class Mjcf {
 public:
  Mjcf() {
    text_.imbue(std::locale::classic());
    text_.precision(12);
  }
  template <class T>
  Mjcf& operator<<(const T& item) {
    text_ << item;
    return *this;
  }
  Mjcf& operator<<(const Vector3& v) {
    text_ << v.x() << ' ' << v.y() << ' ' << v.z();
    return *this;
  }
  /// An axis-aligned box in its parent, from corner to corner.
  void box(const std::string& name, const char* group, const Vector3& low,
           const Vector3& high) {
    *this << "<geom name='" << name << "' class='" << group << "' type='box' pos='"
          << Vector3((low + high) / 2) << "' size='" << Vector3((high - low) / 2)
          << "'/>\n";
  }
  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
};

void write_platform(Mjcf& out, const Rig& rig) {
  // Slides and hinges in the order of X_IN: place, yaw, pitch, roll. So heavy that what
  // lands does not move it; its motion is prescribed anyway.
  out << "<body name='platform' pos='0 0 0'>\n"
         "<inertial pos='0 0 0' mass='1e5' diaginertia='1e5 1e5 1e5'/>\n"
         "<joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 1 0'/>"
         "<joint type='slide' axis='0 0 1'/><joint type='hinge' axis='0 0 1'/>"
         "<joint type='hinge' axis='0 1 0'/><joint type='hinge' axis='1 0 0'/>\n";
  const double half = rig.pad.size_m / 2;
  out.box("pad", "ground", {-half, -half, -kPadThickness}, {half, half, 0});

  const Pose X_NH = housing_from_optical(rig.camera.X_NC);
  const Vector3 p = X_NH.translation();
  const Eigen::Quaterniond q(X_NH.linear());
  // A stereo camera of 90 x 25 x 25 mm whose lens is the origin of H.
  out << "<body pos='" << p << "' quat='" << q.w() << ' ' << q.x() << ' ' << q.y()
      << ' ' << q.z()
      << "'><geom name='housing' class='ground' type='box' pos='-0.0125 0 0' "
         "size='0.0125 0.045 0.0125'/></body>\n";
  const double deck = -kChassisBelow;
  if (rig.pad.above_floor_m > 0.1) {
    const double reach = std::max(half, std::abs(p.x()) + 0.05);
    const double wide = std::max(half, std::abs(p.y()) + 0.05);
    const double front = p.x() >= 0 ? reach : half;
    const double back = p.x() >= 0 ? half : reach;
    out.box("chassis", "ground", {-back, -wide, -rig.pad.above_floor_m + 0.03},
            {front, wide, deck});
  }
  if (p.z() - 0.02 > deck) {
    // The post stands on the lens's far side.
    const Vector3 behind = p - 0.02 * X_NH.linear().col(0);
    out.box("post", "ground", {behind.x() - 0.01, behind.y() - 0.01, deck},
            {behind.x() + 0.01, behind.y() + 0.01, p.z() - 0.01});
  }
  int k = 0;
  for (const Obstacle& box : rig.pad.obstacles) {
    out.box("obstacle" + std::to_string(k++), "ground", box.min_m, box.max_m);
  }
  out << "</body>\n";
}

void write_drone(Mjcf& out, const TrueRig& truth) {
  const DroneSpec& drone = truth.rig.drone;
  out << "<body name='drone' pos='0 0 0'><freejoint/>\n<inertial pos='"
      << truth.extras.p_FCom << "' mass='" << drone.mass_kg << "' diaginertia='"
      << drone.inertia_kg_m2 << "'/>\n";
  for (int i = 0; i < 4; ++i) {
    Vector3 centre = Scene::foot(drone, i);
    centre.z() += kFootRadius;
    out << "<geom name='foot" << i << "' class='drone' type='sphere' size='"
        << kFootRadius << "' pos='" << centre << "'/>\n";
  }
  const double hull = drone.arm_m / 2;
  const double belly = std::min(0.025, drone.gear_height_m / 2);
  out.box("body", "drone", {-hull, -hull, -belly}, {hull, hull, 0.03});
  const RotorLayout rotors(drone);
  for (std::size_t i = 0; i < kRotors; ++i) {
    out << "<geom name='rotor" << i << "' class='drone' type='cylinder' size='"
        << drone.propeller_radius_m << " 0.006' pos='" << rotors.p_FR[i] << "'/>\n";
  }
  out << "</body>\n";
}

}  // namespace

Vector3 Scene::foot(const DroneSpec& drone, int i) {
  const double a = 0.55 * drone.arm_m;
  return {i < 2 ? a : -a, i % 2 == 0 ? a : -a, -drone.gear_height_m};
}

std::string scene_mjcf(const TrueRig& rig, Seconds step) {
  Mjcf out;
  // Gravity is applied to the drone alone, as a force: the platform's motion is given.
  out << "<mujoco><compiler angle='radian'/>\n<option timestep='" << step
      << "' gravity='0 0 0' cone='elliptic' impratio='100' iterations='8' "
         "tolerance='1e-6'>"
         "<flag energy='disable'/></option>\n"
         "<size nconmax='64' njmax='256'/>\n"
         "<default><geom friction='0.8 0.003 0.0001' solref='0.01 1'/>\n"
         "<default class='drone'><geom contype='1' conaffinity='2'/></default>\n"
         "<default class='ground'><geom contype='2' conaffinity='1'/></default>\n"
         "</default>\n<worldbody>\n"
         "<geom name='floor' class='ground' type='plane' size='0 0 1'/>\n";
  write_platform(out, rig.rig);
  write_drone(out, rig);
  out << "</worldbody></mujoco>\n";
  return out.text();
}

}  // namespace alight
