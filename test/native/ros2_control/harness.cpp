// Copyright 2026 The masmc_ros authors
// SPDX-License-Identifier: Apache-2.0

// Runs of a generated controller with the simulated robot of its library, without ROS:
//   harness run PATH APPROACH_SPEED [wheels]  all torques on stdout, allocations in update() on stderr
//   harness events PATH               modes and commands after faults, requests and parameters
//   harness jitter PATH SECONDS [NS]  lateness and duration of each update() in ns, at a period NS
#include <dlfcn.h>
#include <time.h>

#include <cmath>
#include <cstdlib>
#include <cstring>

#include "stand_in.hpp"

#include "paper_controller/controller.hpp"

static bool is_counting = false;
static long allocations = 0, locks = 0;

extern "C" {
void * __libc_malloc(std::size_t size);
void * __libc_calloc(std::size_t count, std::size_t size);
void * __libc_realloc(void * old, std::size_t size);

void * malloc(std::size_t size)
{
  allocations += is_counting;
  return __libc_malloc(size);
}
void * calloc(std::size_t count, std::size_t size)
{
  allocations += is_counting;
  return __libc_calloc(count, size);
}
void * realloc(void * old, std::size_t size)
{
  allocations += is_counting;
  return __libc_realloc(old, size);
}
int pthread_mutex_lock(pthread_mutex_t * mutex)
{
  static const auto lock =
    reinterpret_cast<int (*)(pthread_mutex_t *)>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
  locks += is_counting;
  return lock(mutex);
}
}

std::unique_ptr<controller_interface::ControllerInterface> new_controller();

constexpr std::int64_t kPeriod = 1000000;

/// Simulated robot whose positions, velocities and efforts are the interfaces.
class Robot
{
public:
  Robot() { paper_plant_start(&settings_, &memory_, delay_line_, &signals); }

  void lend(controller_interface::ControllerInterface & controller)
  {
    std::vector<hardware_interface::LoanedStateInterface> states;
    std::vector<hardware_interface::LoanedCommandInterface> commands;
    const auto names = controller.state_interface_configuration().names;
    for (std::size_t i = names.size(); i-- > 0;) {
      // In reverse: a controller finds its interfaces by name.
      // The pose of a fixed base has no interface.
      const std::size_t count = names.size() / 2, fixed = PAPER_POSITION - count;
      states.emplace_back(
        names[i],
        i < count ? &signals.position[fixed + i] : &signals.velocity[fixed + i - count]);
    }
    const auto efforts = controller.command_interface_configuration().names;
    for (std::size_t i = 0; i < efforts.size(); i++) {
      commands.emplace_back(efforts[i], &effort[i]);
    }
    controller.assign_interfaces(std::move(commands), std::move(states));
  }

  void move()
  {
    std::memcpy(signals.torque, effort, sizeof signals.torque);
    paper_plant_tick(&settings_, &memory_, delay_line_, tick++, &signals);
  }

  paper_signals signals = paper_signals_initial;
  double effort[sizeof paper_signals::torque / sizeof(double)] = {};
  std::int64_t tick = 0;

private:
  paper_plant_settings settings_ = paper_plant_settings_initial;
  paper_plant_memory memory_ = paper_plant_memory_initial;
  double delay_line_[PAPER_DELAY_LINE] = {};
};

using Controller = controller_interface::ControllerInterface;

void update(Controller & controller, std::int64_t stamp)
{
  const rclcpp::Time time(stamp);
  const rclcpp::Duration period{std::chrono::nanoseconds(kPeriod)};
  is_counting = true;
  const auto result = controller.update(time, period);
  is_counting = false;
  if (result != controller_interface::return_type::OK) {
    std::exit(3);
  }
}

std::unique_ptr<Controller> started(
  Robot & robot, const char * path, const std::map<std::string, double> & parameters,
  bool by_wheels = false)
{
  auto controller = new_controller();
  controller->update_rate = 1000;
  controller->on_init();
  controller->get_node()->set("path", std::string(path));
  if (by_wheels) {
    controller->get_node()->set("wheel_odometry", true);
  }
  for (const auto & [name, value] : parameters) {
    controller->get_node()->set(name, value);
  }
  const rclcpp_lifecycle::State state;
  if (controller->on_configure(state) != controller_interface::CallbackReturn::SUCCESS) {
    std::exit(2);
  }
  robot.lend(*controller);
  if (controller->on_activate(state) != controller_interface::CallbackReturn::SUCCESS) {
    std::exit(2);
  }
  return controller;
}

int run(const char * path, double speed, bool by_wheels)
{
  Robot robot;
  const auto controller = started(robot, path, {{"approach_speed", speed}}, by_wheels);
  for (std::int64_t tick = 0; tick < PAPER_TICKS; tick++) {
    update(*controller, tick * kPeriod);
    std::fwrite(robot.effort, sizeof robot.effort, 1, stdout);
    robot.move();
  }
  std::fprintf(stderr, "%ld allocations, %ld locks\n", allocations, locks);
  return 0;
}

/// Let time pass, then print the mode by the controller's own report, and the command.
void pass(Controller & controller, Robot & robot, const char * event, int ticks, bool is_lost)
{
  for (int i = 0; i < ticks; i++) {
    const double position = robot.signals.position[5];
    robot.signals.position[5] = is_lost ? NAN : position;
    update(controller, robot.tick * kPeriod);
    robot.signals.position[5] = position;
    robot.move();
  }
  double sum = 0.0;
  for (const double effort : robot.effort) {
    sum += std::fabs(effort);
  }
  controller.get_node()->on_timer();
  std::fprintf(
    stderr, "%s: %s\n", event, sum == 0.0 ? "void" : std::isfinite(sum) ? "torque" : "nan");
}

int events(const char * path)
{
  Robot robot;
  const auto controller = started(robot, path, {});
  auto & node = *controller->get_node();
  pass(*controller, robot, "start", 200, false);
  for (const auto & [value, text] : {std::pair{150.0, "valid"}, std::pair{-1.0, "negative"}}) {
    const auto result = node.set_live("k_s1", std::vector<double>{value});
    std::fprintf(stderr, "%s: %s\n", text, result.successful ? "set" : result.reason.c_str());
  }
  pass(*controller, robot, "gain", 100, false);
  pass(*controller, robot, "lost for 50 ms", 50, true);
  pass(*controller, robot, "lost for 150 ms", 100, true);
  pass(*controller, robot, "lost for 350 ms", 200, true);
  pass(*controller, robot, "states again", 300, false);
  node.services.at("~/emergency_stop")(true);
  pass(*controller, robot, "stop", 1000, false);
  node.services.at("~/clear_fault")(true);
  pass(*controller, robot, "clear", 10, false);
  node.services.at("~/enable")(true);
  pass(*controller, robot, "enable", 100, false);
  std_msgs::msg::Float64MultiArray message;
  message.data = {1.0, 2.0};
  node.on_message(message);
  controller->on_deactivate({});
  std::fprintf(stderr, "deactivated: %g\n", robot.effort[0]);
  std::fprintf(stderr, "%ld allocations, %ld locks\n", allocations, locks);
  return 0;
}

std::int64_t now()
{
  timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return time.tv_sec * 1000000000LL + time.tv_nsec;
}

int jitter(const char * path, double seconds, std::int64_t period)
{
  Robot robot;
  const auto controller = started(robot, path, {});
  const auto count = static_cast<std::size_t>(1e9 * seconds / static_cast<double>(period));
  std::vector<std::int64_t> figures(2 * count);
  std::int64_t due = now() + period;
  for (std::size_t i = 0; i < count; i++, due += period) {
    const timespec time{due / 1000000000, due % 1000000000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr);
    const std::int64_t start = now();
    update(*controller, robot.tick * kPeriod);
    figures[2 * i] = start - due;
    figures[2 * i + 1] = now() - start;
    robot.move();
  }
  std::fwrite(figures.data(), sizeof figures[0], figures.size(), stdout);
  return 0;
}

int main(int count, char ** arguments)
{
  const std::string mode = count > 2 ? arguments[1] : "";
  if (mode == "run" && count >= 4) {
    return run(arguments[2], std::atof(arguments[3]), count > 4);
  }
  if (mode == "events") {
    return events(arguments[2]);
  }
  if (mode == "jitter" && count >= 4) {
    return jitter(arguments[2], std::atof(arguments[3]), count > 4 ? std::atoll(arguments[4]) : kPeriod);
  }
  std::fputs("expected run PATH SPEED [wheels], events PATH or jitter PATH SECONDS [NS]\n", stderr);
  return 1;
}
