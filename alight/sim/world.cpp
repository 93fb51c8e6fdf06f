#include "alight/sim/world.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "alight/sim/autopilot.h"
#include "alight/sim/camera_config.h"
#include "alight/sim/contact_watch.h"
#include "alight/sim/odometry_sensor.h"
#include "alight/sim/platform_motion.h"
#include "alight/sim/radio.h"
#include "alight/sim/rotors.h"
#include "alight/sim/scene.h"
#include "alight/sim/scene_at.h"
#include "alight/sim/wind.h"

namespace alight {
namespace {

constexpr double kRateDamping = 0.5;  // 1/s
constexpr int kWindEvery = 5;         // steps
constexpr int kTelemetryEvery = 10;   // steps: 50 Hz
constexpr int kPingEvery = 50;        // steps: 10 Hz
constexpr std::size_t kRing = 128;    // more than kMemory of steps
static_assert(kRing > static_cast<std::size_t>(World::kMemory / World::kStep) + 1);

AutopilotConfig autopilot_config(const Scenario& scenario, const DroneSpec& nominal,
                                 const TrueRig& truth, Rng rng) {
  AutopilotConfig config;
  // Its pilot has set it as the drone hovers, not as the rig file says.
  const double heavier = truth.rig.drone.mass_kg / nominal.mass_kg;
  const double hover = heavier / truth.extras.thrust_scale / nominal.thrust_to_weight;
  const double error = scenario.autopilot.hover_error;
  config.hover_share = hover * (1 + rng.uniform(-error, error));
  config.belief.external_pose = scenario.autopilot.external_pose;
  config.belief.dead_reckoning_s = 1e-3 * scenario.autopilot.blind_after_ms;
  config.belief.tilt_error_deg = scenario.autopilot.tilt_error_deg;
  config.belief.heading_drift_deg_min = scenario.autopilot.heading_drift_deg_min;
  config.loss_s = 1e-3 * scenario.autopilot.link_loss_ms;
  config.loss_action = scenario.autopilot.link_loss;
  config.land_speed_m_s = scenario.autopilot.land_speed_m_s;
  return config;
}

/// Where the airframe stands at the start, in N.
Pose start_pose(const Scenario& scenario, const Rig& rig, Rng rng) {
  const double x = rng.uniform(-0.03, 0.03);
  const double y = rng.uniform(-0.03, 0.03);
  const double yaw = rng.uniform(-5, 5) * kDegree;
  const double back = rng.uniform(1.2, 1.5);
  const double side = rng.uniform(-0.1, 0.1);
  Vector3 p_NF(x, y, rig.drone.gear_height_m);
  if (scenario.start.place == StartPlace::floor) {
    // Beyond the pad, where the camera looks, and turned as on it; a large one farther.
    const double scale = std::max(1.0, rig.drone.size_m / DroneSpec{}.size_m);
    const Vector3 to_lens = leds_face(rig);
    const Vector3 across(-to_lens.y(), to_lens.x(), 0);
    p_NF = scale * (-back * to_lens + side * across);
    p_NF.z() = rig.drone.gear_height_m - rig.pad.above_floor_m;
  }
  return make_pose(from_rpy(0, 0, yaw), p_NF);
}

}  // namespace

void SensorBatch::clear() {
  odometry.clear();
  imu.clear();
  telemetry.clear();
  link.clear();
  dropped = 0;
}

struct World::Parts {
  Scenario scenario;
  TrueRig rig;
  PlatformMotion platform;
  std::unique_ptr<Scene> scene;
  Wind wind;
  Rotors rotors;
  Autopilot autopilot;
  Radio radio;
  OdometrySensor odometry;
  ContactWatch contacts;

  Time now = 0;
  std::int64_t steps = 0;
  Vector3 air_I = Vector3::Zero();
  std::array<TruthState, kRing> ring{};
  std::vector<bool> begun;  ///< Which faults.
  double round_trip_ms = 0;
  Time last_answer = 0;
  bool answered = false;
  Rng chance;
  FixedVector<AutopilotTelemetry, 64> telemetry;
  FixedVector<LinkStatus, 16> link;
  int dropped = 0;

  Parts(const Scenario& s, const Rig& nominal, const TrueRig& truth,
        PlatformMotion motion, std::unique_ptr<Scene> bodies, const Rng& rng)
      : scenario(s),
        rig(truth),
        platform(std::move(motion)),
        scene(std::move(bodies)),
        wind(s.wind, rng.fork("wind")),
        rotors(nominal.drone, truth.extras.thrust_scale),
        autopilot(autopilot_config(s, nominal.drone, truth, rng.fork("hover")),
                  nominal.drone, rng.fork("autopilot")),
        radio(s.radio, rng.fork("radio")),
        odometry(s.odometry, platform.state(), rng.fork("odometry")),
        contacts(truth.rig.drone, truth.rig.pad),
        chance(rng.fork("faults")) {
    begun.resize(s.faults.size());
  }

  const FaultScenario* fault(FaultKind kind, Time t) const {
    return active_fault(scenario.faults, kind, t);
  }
  /// Calls `act` with each fault of this kind once, when it begins.
  template <class Act>
  void at_begin(FaultKind kind, Act&& act);
  void break_autopilot();
  PadMutiny mutiny() const;
  void step();
  Wrench air_and_rotors(const BodyMotion& body, const PlatformState& deck);
  double gust_of_fault() const;
  bool air_dead(RadioEnd to) const;
  void run_radio();
  void run_odometry();
  TruthState observe() const;
  TruthState& slot(std::int64_t step) {
    return ring[static_cast<std::size_t>(step) % kRing];
  }
};

World::World(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
World::~World() = default;

Result<std::unique_ptr<World>> World::create(const Scenario& scenario,
                                             const Rig& nominal, std::uint64_t seed) {
  if (auto ok = scenario.validate(); !ok) return fail(ok.error());
  if (auto ok = nominal.validate(); !ok) return fail(ok.error());
  if (scenario.platform.kind == PlatformKind::recorded) {
    if (auto ok = RecordedDrive::create(scenario.platform.drive); !ok) {
      return fail(ok.error().fault, "platform.file: " + ok.error().detail);
    }
  }
  for (std::size_t k = 0; k < scenario.faults.size(); ++k) {
    const FaultScenario& f = scenario.faults[k];
    const bool of_led = f.kind == FaultKind::led_dead ||
                        f.kind == FaultKind::led_flicker ||
                        f.kind == FaultKind::led_dim;
    if (of_led && f.led >= nominal.leds.size()) {
      return fail(Fault::invalid_config, "faults[" + std::to_string(k) + "].led is " +
                                             std::to_string(static_cast<int>(f.led)) +
                                             ", the rig has LEDs 0 to " +
                                             std::to_string(nominal.leds.size() - 1));
    }
  }
  const Rng rng(seed);
  const TrueRig truth = draw_true_rig(nominal, scenario.rig_error, rng.fork("rig"));
  PlatformMotion platform(scenario.platform, nominal.pad.above_floor_m,
                          scenario.start.platform_moving, rng.fork("platform"));
  const Pose X_IF =
      platform.state().X_IN * start_pose(scenario, truth.rig, rng.fork("start"));
  auto scene = Scene::create(truth, X_IF, platform.state(), to_seconds(kStep));
  if (!scene) return fail(scene.error());
  auto parts = std::make_unique<Parts>(scenario, nominal, truth, std::move(platform),
                                       std::move(*scene), rng);
  parts->slot(0) = parts->observe();
  return std::unique_ptr<World>(new World(std::move(parts)));
}

void World::advance_to(Time t) {
  while (parts_->now + kStep <= t) parts_->step();
}

void World::Parts::step() {
  const double dt = to_seconds(kStep);
  run_radio();

  if (steps % kWindEvery == 0) {
    const double airspeed = (wind.mean() - scene->body().v_IF).norm();
    air_I = wind.step(dt * kWindEvery, airspeed) + gust_of_fault() * wind.direction();
  }
  break_autopilot();
  const BodyMotion& body = scene->body();
  const Autopilot::Sensed sensed{body.X_IF.linear(), body.w_F, body.f_F, body.v_IF.z(),
                                 rotors.battery()};
  const RotorShares shares = autopilot.step(sensed, now, dt);
  rotors.step(shares, autopilot.motors_running(), dt);

  const PlatformState before = platform.state();
  platform.step(dt, mutiny());
  const Wrench wrench = air_and_rotors(body, before);
  scene->step(before, platform.state(), wrench.force, wrench.moment);

  const TruthState previous = slot(steps);
  ++steps;
  now += kStep;
  slot(steps) = observe();
  contacts.step(scene->touches(), previous, slot(steps), rig.extras.R_FB);
  run_odometry();
}

Wrench World::Parts::air_and_rotors(const BodyMotion& body, const PlatformState& deck) {
  const DroneSpec& drone = rig.rig.drone;
  const Matrix3& R_IF = body.X_IF.linear();
  const Pose X_NF = deck.X_IN.inverse() * body.X_IF;
  const double half = rig.rig.pad.size_m / 2;
  std::array<double, kRotors> ground{};
  for (std::size_t i = 0; i < kRotors; ++i) {
    const Vector3& p_FR = rotors.layout().p_FR[i];
    const Vector3 p_NR = X_NF * p_FR;
    // The share of the disc over the pad, along each edge as if the disc were square.
    double over_pad = p_NR.z() > 0 ? 1 : 0;
    for (int axis = 0; axis < 2; ++axis) {
      const double inside = half - std::abs(p_NR[axis]);
      over_pad *= std::clamp(0.5 + inside / (2 * drone.propeller_radius_m), 0.0, 1.0);
    }
    const double on_pad =
        ground_effect(p_NR.z(), drone.propeller_radius_m, drone.arm_m);
    const double on_floor =
        ground_effect((body.X_IF * p_FR).z(), drone.propeller_radius_m, drone.arm_m);
    ground[i] = over_pad * on_pad + (1 - over_pad) * on_floor;
  }
  const Wrench rotors_F = rotors.wrench(ground);
  Wrench sum;
  sum.force = R_IF * rotors_F.force -
              drone.mass_kg * rig.extras.drag_per_s * (body.v_IF - air_I);
  const Vector3 damping_F = kRateDamping * drone.inertia_kg_m2.cwiseProduct(body.w_F);
  sum.moment = R_IF * (rotors_F.moment - damping_F);
  return sum;
}

template <class Act>
void World::Parts::at_begin(FaultKind kind, Act&& act) {
  for (std::size_t k = 0; k < begun.size(); ++k) {
    const FaultScenario& f = scenario.faults[k];
    if (begun[k] || f.kind != kind || to_seconds(now) < f.at_s) continue;
    begun[k] = true;
    act(f);
  }
}

void World::Parts::break_autopilot() {
  if (scenario.faults.empty()) return;
  autopilot.hold(fault(FaultKind::autopilot_mode, now) != nullptr);
  autopilot.refuse(fault(FaultKind::autopilot_refuse, now) != nullptr);
  at_begin(FaultKind::autopilot_reset, [&](const FaultScenario& f) {
    const double way = chance.uniform(0, 2 * kPi);
    autopilot.reset(f.turn_deg * kDegree,
                    f.reset_m_s * Vector3(std::cos(way), std::sin(way), 0));
  });
  at_begin(FaultKind::battery_low,
           [&](const FaultScenario& f) { rotors.drain_to(f.charge); });
}

PadMutiny World::Parts::mutiny() const {
  PadMutiny mutiny;
  if (const auto* f = fault(FaultKind::pad_start, now)) mutiny.speed_m_s = f->pad_m_s;
  if (fault(FaultKind::pad_stop, now) != nullptr) mutiny = {0, 0};
  if (const auto* f = fault(FaultKind::pad_turn, now)) {
    mutiny.turn_rad_s = f->pad_deg_s * kDegree;
  }
  return mutiny;
}

double World::Parts::gust_of_fault() const {
  double sum = 0;
  for (const FaultScenario& f : scenario.faults) {
    const double into = to_seconds(now) - f.at_s;
    if (f.kind != FaultKind::gust || into < 0 || into > f.for_s) continue;
    sum += f.gust_m_s * 0.5 * (1 - std::cos(2 * kPi * into / f.for_s));
  }
  return sum;
}

bool World::Parts::air_dead(RadioEnd to) const {
  const FaultKind one_way =
      to == RadioEnd::drone ? FaultKind::uplink_out : FaultKind::telemetry_out;
  return fault(FaultKind::radio_out, now) != nullptr || fault(one_way, now) != nullptr;
}

void World::Parts::run_radio() {
  if (fault(FaultKind::radio_out, now) != nullptr) radio.clear();
  if (const auto* stall = fault(FaultKind::radio_stall, now)) {
    radio.hold(from_seconds(stall->at_s + stall->for_s));
  }
  const bool deaf = air_dead(RadioEnd::ground);
  if (steps % kTelemetryEvery == 0) {
    radio.send(autopilot.telemetry(now), RadioEnd::ground, now, deaf);
  }
  if (steps % kPingEvery == 0) {
    radio.send(Ping{now}, RadioEnd::drone, now, air_dead(RadioEnd::drone));
    if (answered) {
      dropped += !link.push_back({now, now, round_trip_ms, last_answer});
    }
  }
  while (const auto arrival = radio.receive(RadioEnd::drone, now)) {
    if (const auto* s = std::get_if<Setpoint>(&arrival->message)) {
      autopilot.receive(*s, arrival->sent, now);
    } else if (const auto* p = std::get_if<ExternalPose>(&arrival->message)) {
      autopilot.receive(*p, now);
    } else if (const auto* o = std::get_if<AutopilotOrder>(&arrival->message)) {
      autopilot.receive(*o, now);
    } else if (const auto* ping = std::get_if<Ping>(&arrival->message)) {
      radio.send(Pong{ping->sent}, RadioEnd::ground, now, deaf);
    }
  }
  while (auto arrival = radio.receive(RadioEnd::ground, now)) {
    answered = true;
    last_answer = arrival->received;
    if (auto* told = std::get_if<AutopilotTelemetry>(&arrival->message)) {
      told->received = arrival->received;
      dropped += !telemetry.push_back(*told);
    } else if (const auto* pong = std::get_if<Pong>(&arrival->message)) {
      round_trip_ms = to_seconds(arrival->received - pong->ping_sent) * 1e3;
    }
  }
}

void World::Parts::run_odometry() {
  if (!scenario.faults.empty()) {
    const Vector3 ahead = platform.state().X_IN.linear().col(0);
    at_begin(FaultKind::odometry_jump,
             [&](const FaultScenario& f) { odometry.jump(f.jump_m * ahead); });
    at_begin(FaultKind::odometry_shift,
             [&](const FaultScenario& f) { odometry.jump(f.jump_m * ahead, false); });
    const auto* drift = fault(FaultKind::odometry_drift, now);
    odometry.drift(Vector3(0, drift ? drift->drift_m_s : 0, 0),
                   drift ? drift->drift_deg_s * kDegree : 0);
  }
  odometry.step(platform.state(), fault(FaultKind::odometry_out, now) != nullptr);
}

TruthState World::Parts::observe() const {
  const BodyMotion& body = scene->body();
  TruthState truth;
  truth.t = now;
  truth.platform = platform.state();
  truth.X_IB = body.X_IF * make_pose(rig.extras.R_FB, Vector3::Zero());
  truth.X_NB = truth.platform.X_IN.inverse() * truth.X_IB;
  truth.v_IB = body.v_IF;
  truth.v_NB = truth.platform.X_IN.linear().transpose() * body.v_IF -
               truth.platform.v_IN_N -
               truth.platform.w_IN_N.cross(Vector3(truth.X_NB.translation()));
  truth.w_IB_B = rig.extras.R_FB.transpose() * body.w_F;
  truth.rotor_share = rotors.mean_share();
  truth.motors_running = autopilot.motors_running();
  truth.mode = autopilot.mode();
  return truth;
}

const FaultScenario* World::fault(FaultKind kind, Time t) const {
  return parts_->fault(kind, t);
}

void World::send(const Setpoint& setpoint, Time now) {
  if (setpoint.kind == Setpoint::Kind::none) return;
  parts_->radio.send(setpoint, RadioEnd::drone, now, parts_->air_dead(RadioEnd::drone));
}
void World::send(const ExternalPose& pose, Time now) {
  parts_->radio.send(pose, RadioEnd::drone, now, parts_->air_dead(RadioEnd::drone));
}
void World::send(AutopilotOrder order, Time now) {
  if (order == AutopilotOrder::none) return;
  parts_->radio.send(order, RadioEnd::drone, now, parts_->air_dead(RadioEnd::drone));
}

void World::wish_platform_speed(double m_s) { parts_->platform.wish_speed(m_s); }
void World::start_platform() { parts_->platform.start(); }

void World::collect(Time now, SensorBatch& out) {
  Parts& p = *parts_;
  PlatformOdometry odometry;
  while (p.odometry.receive(now, odometry)) {
    out.dropped += !out.odometry.push_back(odometry);
  }
  PlatformImu imu;
  while (p.odometry.receive(now, imu)) out.dropped += !out.imu.push_back(imu);
  for (const auto& told : p.telemetry) out.dropped += !out.telemetry.push_back(told);
  for (const auto& status : p.link) out.dropped += !out.link.push_back(status);
  p.telemetry.clear();
  p.link.clear();
  out.dropped += p.dropped;
  p.dropped = 0;
}

const TruthState& World::truth() const { return parts_->slot(parts_->steps); }

TruthState World::truth_at(Time t) const {
  Parts& p = *parts_;
  const Time oldest = std::max<Time>(0, p.now - kMemory);
  t = std::clamp(t, oldest, p.now);
  const std::int64_t step = t / kStep;
  const TruthState& a = p.slot(step);
  if (t == a.t) return a;
  const TruthState& b = p.slot(step + 1);
  const double u = to_seconds(t - a.t) / to_seconds(kStep);
  const auto blend = [u](const Vector3& x, const Vector3& y) -> Vector3 {
    return x + u * (y - x);
  };
  TruthState mid = a;
  mid.t = t;
  mid.platform.t = t;
  mid.platform.X_IN = between(a.platform.X_IN, b.platform.X_IN, u);
  mid.platform.v_IN_N = blend(a.platform.v_IN_N, b.platform.v_IN_N);
  mid.platform.w_IN_N = blend(a.platform.w_IN_N, b.platform.w_IN_N);
  mid.X_IB = between(a.X_IB, b.X_IB, u);
  mid.X_NB = mid.platform.X_IN.inverse() * mid.X_IB;
  mid.v_IB = blend(a.v_IB, b.v_IB);
  mid.v_NB = blend(a.v_NB, b.v_NB);
  mid.w_IB_B = blend(a.w_IB_B, b.w_IB_B);
  return mid;
}

const ContactReport& World::contact() const { return parts_->contacts.report(); }
bool World::standing_on_pad() const {
  return parts_->contacts.standing_on_pad(truth());
}
const TrueRig& World::true_rig() const { return parts_->rig; }
const Scenario& World::scenario() const { return parts_->scenario; }

}  // namespace alight
