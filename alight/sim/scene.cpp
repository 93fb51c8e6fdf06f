#include "alight/sim/scene.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>
#include <vector>

#include "alight/geometry/so3.h"

namespace alight {
namespace {

constexpr int kPlatformJoints = 6;  // first in qpos and qvel; the drone's follow

constexpr double kPlatformMass = 1e5;  // kg and kg m^2, as in the scene

using Joints = Eigen::Matrix<double, kPlatformJoints, 1>;

/// Joint coordinates of a platform pose, yaw unwrapped next to `yaw_near`.
Joints joints_of(const Pose& X_IN, double yaw_near) {
  const Matrix3& R = X_IN.linear();
  const double yaw = yaw_near + wrap_angle(yaw_of(R) - yaw_near);
  const double pitch = -std::asin(std::clamp(R(2, 0), -1.0, 1.0));
  const double roll = std::atan2(R(2, 1), R(2, 2));
  Joints q;
  q << X_IN.translation(), yaw, pitch, roll;
  return q;
}

/// Rates of those coordinates.
Joints joint_rates(const PlatformState& platform, const Joints& q) {
  const Vector3& w = platform.w_IN_N;
  const double pitch = q[4], roll = q[5];
  const double level = w.y() * std::sin(roll) + w.z() * std::cos(roll);
  Joints rates;
  rates << platform.X_IN.linear() * platform.v_IN_N, level / std::cos(pitch),
      w.y() * std::cos(roll) - w.z() * std::sin(roll), w.x() + std::tan(pitch) * level;
  return rates;
}

Touch part_of(std::string_view name) {
  Touch part;
  const auto is = [&](std::string_view prefix) {
    return name.substr(0, prefix.size()) == prefix;
  };
  if (is("foot")) {
    part.ours = Part::foot;
    part.foot = name.back() - '0';
  } else if (is("body")) {
    part.ours = Part::body;
  } else if (is("rotor")) {
    part.ours = Part::rotor;
  } else if (is("pad")) {
    part.ours = Part::pad;
  } else if (is("chassis")) {
    part.ours = Part::chassis;
  } else if (is("housing") || is("post")) {
    part.ours = Part::housing;
  } else if (is("obstacle")) {
    part.ours = Part::obstacle;
  } else {
    part.ours = Part::floor;
  }
  return part;
}

bool is_drone(Part part) {
  return part == Part::foot || part == Part::body || part == Part::rotor;
}

// The library's own handlers write a file in the working folder.
void say_nothing(const char*) {}

}  // namespace

struct Scene::Parts {
  mjModel* model = nullptr;
  mjData* data = nullptr;
  int drone = 0;             ///< body
  std::vector<Touch> geoms;  ///< What each geom is, in `ours`.
  Vector3 p_FCom;
  double weight = 0;  ///< N
  double yaw = 0;     ///< of the platform, unwrapped
  double dt = 0;
  Joints rates = Joints::Zero();  ///< of the platform, in the last step
  BodyMotion body;
  FixedVector<Touch, 32> touches;

  ~Parts() {
    if (data) mj_deleteData(data);
    if (model) mj_deleteModel(model);
  }
  void read_body(bool settled) {
    const mjtNum* q = data->qpos + kPlatformJoints;
    const mjtNum* v = data->qvel + kPlatformJoints;
    const Eigen::Quaterniond turn(q[3], q[4], q[5], q[6]);
    body.X_IF = make_pose(turn.normalized().toRotationMatrix(), {q[0], q[1], q[2]});
    body.v_IF = {v[0], v[1], v[2]};
    body.w_F = {v[3], v[4], v[5]};
    const mjtNum* a = data->qacc + kPlatformJoints;
    const Vector3 a_I = settled ? Vector3(a[0], a[1], a[2]) : Vector3::Zero();
    body.f_F = body.X_IF.linear().transpose() * (a_I + Vector3(0, 0, kGravity));
  }
};

Scene::Scene(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Scene::~Scene() = default;

Result<std::unique_ptr<Scene>> Scene::create(const TrueRig& rig, const Pose& X_IF,
                                             const PlatformState& platform,
                                             Seconds step) {
  // One for all threads: once only, as others may be reading it.
  [[maybe_unused]] static const bool silent = [] {
    mju_user_warning = say_nothing;
    return true;
  }();
  auto parts = std::make_unique<Parts>();
  const std::string xml = scene_mjcf(rig, step);

  auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  mj_makeEmptyFileVFS(files.get(), "scene.xml", static_cast<int>(xml.size()));
  std::memcpy(files->filedata[0], xml.data(), xml.size());
  char why[500] = "";
  parts->model = mj_loadXML("scene.xml", files.get(), why, sizeof why);
  mj_deleteVFS(files.get());
  if (!parts->model) {
    return fail(Fault::invalid_config,
                std::string("the rig makes no scene that MuJoCo accepts: ") + why);
  }
  parts->data = mj_makeData(parts->model);
  mjModel& model = *parts->model;
  parts->drone = mj_name2id(&model, mjOBJ_BODY, "drone");
  for (int g = 0; g < model.ngeom; ++g) {
    parts->geoms.push_back(part_of(mj_id2name(&model, mjOBJ_GEOM, g)));
  }
  parts->p_FCom = rig.extras.p_FCom;
  parts->weight = rig.rig.drone.mass_kg * kGravity;
  parts->dt = step;
  parts->yaw = yaw_of(platform.X_IN.linear());

  const Joints q = joints_of(platform.X_IN, parts->yaw);
  for (int j = 0; j < kPlatformJoints; ++j) parts->data->qpos[j] = q[j];
  mjtNum* free = parts->data->qpos + kPlatformJoints;
  const Eigen::Quaterniond turn(X_IF.linear());
  for (int j = 0; j < 3; ++j) free[j] = X_IF.translation()[j];
  free[3] = turn.w();
  free[4] = turn.x();
  free[5] = turn.y();
  free[6] = turn.z();
  // It has always stood there: it moves as the platform does.
  parts->rates = joint_rates(platform, q);
  const Pose X_NF = platform.X_IN.inverse() * X_IF;
  const Vector3 v_I =
      platform.X_IN.linear() *
      inertial_velocity_N(platform, X_NF.translation(), Vector3::Zero());
  const Vector3 w_F = X_NF.linear().transpose() * platform.w_IN_N;
  for (int j = 0; j < 3; ++j) {
    parts->data->qvel[kPlatformJoints + j] = v_I[j];
    parts->data->qvel[kPlatformJoints + 3 + j] = w_F[j];
  }
  parts->read_body(false);
  return std::unique_ptr<Scene>(new Scene(std::move(parts)));
}

void Scene::step(const PlatformState& now, const PlatformState& next,
                 const Vector3& force_I, const Vector3& moment_I) {
  Parts& s = *parts_;
  mjData& d = *s.data;
  const Joints from = joints_of(now.X_IN, s.yaw);
  const Joints to = joints_of(next.X_IN, from[3]);
  s.yaw = to[3];
  for (int j = 0; j < kPlatformJoints; ++j) {
    // Begun with the last step's speed and pushed to this one's, so that friction sees
    // the acceleration coming and what stands on the pad does not creep.
    const double rate = (to[j] - from[j]) / s.dt;
    d.qpos[j] = from[j];
    d.qvel[j] = s.rates[j];
    d.qfrc_applied[j] = kPlatformMass * (rate - s.rates[j]) / s.dt;
    s.rates[j] = rate;
  }
  // MuJoCo takes the wrench at the centre of mass.
  const Vector3 p_FCom_I = s.body.X_IF.linear() * s.p_FCom;
  const Vector3 moment = moment_I - p_FCom_I.cross(force_I);
  mjtNum* wrench = d.xfrc_applied + 6 * s.drone;
  for (int j = 0; j < 3; ++j) {
    wrench[j] = force_I[j];
    wrench[3 + j] = moment[j];
  }
  wrench[2] -= s.weight;
  mj_step(s.model, s.data);
  s.read_body(true);

  s.touches.clear();
  for (int c = 0; c < d.ncon; ++c) {
    const mjContact& contact = d.contact[c];
    if (contact.dist > 0) continue;
    const Touch& a = s.geoms[static_cast<std::size_t>(contact.geom1)];
    const Touch& b = s.geoms[static_cast<std::size_t>(contact.geom2)];
    Touch touch = is_drone(a.ours) ? a : b;
    touch.theirs = is_drone(a.ours) ? b.ours : a.ours;
    s.touches.push_back(touch);
  }
}

const BodyMotion& Scene::body() const { return parts_->body; }
const FixedVector<Touch, 32>& Scene::touches() const { return parts_->touches; }

}  // namespace alight
