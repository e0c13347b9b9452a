// Copyright 2026 The masmc_ros authors
// SPDX-License-Identifier: Apache-2.0

// Stand-in for the headers of ROS 2 Jazzy that a generated controller uses, with their signatures.
// The workflow compiles the controller against the public headers.
#ifndef STAND_IN_HPP_
#define STAND_IN_HPP_

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#define RCLCPP_INFO(logger, ...) (static_cast<void>(logger), std::fprintf(stderr, __VA_ARGS__), std::fputc('\n', stderr))
#define RCLCPP_ERROR(logger, ...) RCLCPP_INFO(logger, __VA_ARGS__)
#define PLUGINLIB_EXPORT_CLASS(class_type, base_type) \
  std::unique_ptr<base_type> new_controller() { return std::make_unique<class_type>(); }

namespace rcl_interfaces::msg
{
struct SetParametersResult
{
  bool successful = false;
  std::string reason;
};
}  // namespace rcl_interfaces::msg

namespace std_msgs::msg
{
struct Float64MultiArray
{
  std::vector<double> data;
};
}  // namespace std_msgs::msg

namespace std_srvs::srv
{
struct SetBool
{
  struct Request { bool data = false; };
  struct Response { bool success = false; std::string message; };
};
struct Trigger
{
  struct Request {};
  struct Response { bool success = false; std::string message; };
};
}  // namespace std_srvs::srv

namespace rclcpp
{
class Time
{
public:
  explicit Time(std::int64_t nanoseconds = 0) : nanoseconds_(nanoseconds) {}
  std::int64_t nanoseconds() const { return nanoseconds_; }

private:
  std::int64_t nanoseconds_;
};

class Duration
{
public:
  explicit Duration(std::chrono::nanoseconds) {}
};

class QoS
{
public:
  explicit QoS(std::size_t) {}
};

struct Logger {};

class Parameter
{
public:
  using Value = std::variant<
    bool, std::int64_t, double, std::string, std::vector<double>, std::vector<std::string>>;
  Parameter(std::string name, Value value) : name_(std::move(name)), value_(std::move(value)) {}
  const std::string & get_name() const { return name_; }
  bool as_bool() const { return std::get<bool>(value_); }
  std::int64_t as_int() const { return std::get<std::int64_t>(value_); }
  double as_double() const { return std::get<double>(value_); }
  const std::string & as_string() const { return std::get<std::string>(value_); }
  const std::vector<double> & as_double_array() const
  {
    return std::get<std::vector<double>>(value_);
  }
  const std::vector<std::string> & as_string_array() const
  {
    return std::get<std::vector<std::string>>(value_);
  }
  template <typename T>
  T get_value() const { return std::get<T>(value_); }

private:
  std::string name_;
  Value value_;
};

struct TimerBase
{
  using SharedPtr = std::shared_ptr<TimerBase>;
};

template <typename ServiceT>
struct Service
{
  using SharedPtr = std::shared_ptr<Service<ServiceT>>;
};

template <typename MessageT>
struct Subscription
{
  using SharedPtr = std::shared_ptr<Subscription<MessageT>>;
};

namespace node_interfaces
{
struct OnSetParametersCallbackHandle
{
  using SharedPtr = std::shared_ptr<OnSetParametersCallbackHandle>;
};
}  // namespace node_interfaces
}  // namespace rclcpp

namespace rclcpp_lifecycle
{
class State {};

namespace node_interfaces
{
struct LifecycleNodeInterface
{
  enum class CallbackReturn : std::uint8_t { SUCCESS = 97, FAILURE = 98, ERROR = 99 };
  virtual CallbackReturn on_configure(const State &) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_activate(const State &) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_deactivate(const State &) { return CallbackReturn::SUCCESS; }
  virtual ~LifecycleNodeInterface() = default;
};
}  // namespace node_interfaces

class LifecycleNode
{
public:
  rclcpp::Logger get_logger() const { return {}; }
  bool has_parameter(const std::string & name) const { return parameters_.count(name) != 0; }
  template <typename T>
  T declare_parameter(const std::string & name, const T & value)
  {
    parameters_.emplace(name, value);
    return value;
  }
  rclcpp::Parameter get_parameter(const std::string & name) const
  {
    return {name, parameters_.at(name)};
  }
  template <typename CallbackT>
  rclcpp::node_interfaces::OnSetParametersCallbackHandle::SharedPtr add_on_set_parameters_callback(
    CallbackT && callback)
  {
    on_set_ = callback;
    return std::make_shared<rclcpp::node_interfaces::OnSetParametersCallbackHandle>();
  }
  template <typename MessageT, typename CallbackT>
  std::shared_ptr<rclcpp::Subscription<MessageT>> create_subscription(
    const std::string &, const rclcpp::QoS &, CallbackT && callback)
  {
    on_message = callback;
    return std::make_shared<rclcpp::Subscription<MessageT>>();
  }
  template <typename ServiceT, typename CallbackT>
  typename rclcpp::Service<ServiceT>::SharedPtr create_service(
    const std::string & name, CallbackT && callback)
  {
    services[name] = [callback](bool value) {
        auto request = std::make_shared<typename ServiceT::Request>();
        auto response = std::make_shared<typename ServiceT::Response>();
        if constexpr (std::is_same_v<ServiceT, std_srvs::srv::SetBool>) {
          request->data = value;
        }
        callback(request, response);
        return response->success;
      };
    return std::make_shared<rclcpp::Service<ServiceT>>();
  }
  template <typename Rep, typename Ratio, typename CallbackT>
  rclcpp::TimerBase::SharedPtr create_wall_timer(
    std::chrono::duration<Rep, Ratio>, CallbackT callback)
  {
    on_timer = callback;
    return std::make_shared<rclcpp::TimerBase>();
  }

  // For the harness.
  void set(const std::string & name, const rclcpp::Parameter::Value & value)
  {
    parameters_[name] = value;
  }
  rcl_interfaces::msg::SetParametersResult set_live(
    const std::string & name, const rclcpp::Parameter::Value & value)
  {
    const auto result = on_set_({rclcpp::Parameter(name, value)});
    if (result.successful) {
      parameters_[name] = value;
    }
    return result;
  }
  std::function<void(const std_msgs::msg::Float64MultiArray &)> on_message;
  std::map<std::string, std::function<bool(bool)>> services;
  std::function<void()> on_timer;

private:
  std::map<std::string, rclcpp::Parameter::Value> parameters_;
  std::function<rcl_interfaces::msg::SetParametersResult(const std::vector<rclcpp::Parameter> &)>
    on_set_;
};
}  // namespace rclcpp_lifecycle

namespace hardware_interface
{
class LoanedStateInterface
{
public:
  LoanedStateInterface(std::string name, const double * value)
  : name_(std::move(name)), value_(value) {}
  LoanedStateInterface(const LoanedStateInterface &) = delete;
  LoanedStateInterface(LoanedStateInterface &&) = default;
  const std::string & get_name() const { return name_; }
  template <typename T = double>
  [[nodiscard]] std::optional<T> get_optional(unsigned int max_tries = 10) const
  {
    static_cast<void>(max_tries);
    return *value_;
  }

private:
  std::string name_;
  const double * value_;
};

class LoanedCommandInterface
{
public:
  LoanedCommandInterface(std::string name, double * value)
  : name_(std::move(name)), value_(value) {}
  LoanedCommandInterface(const LoanedCommandInterface &) = delete;
  LoanedCommandInterface(LoanedCommandInterface &&) = default;
  const std::string & get_name() const { return name_; }
  template <typename T>
  [[nodiscard]] bool set_value(const T & value, unsigned int max_tries = 10)
  {
    static_cast<void>(max_tries);
    *value_ = value;
    return true;
  }

private:
  std::string name_;
  double * value_;
};
}  // namespace hardware_interface

namespace controller_interface
{
using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;
enum class return_type : std::uint8_t { OK = 0, ERROR = 1 };
enum class interface_configuration_type : std::uint8_t { ALL = 0, INDIVIDUAL = 1, NONE = 2 };
struct InterfaceConfiguration
{
  interface_configuration_type type = interface_configuration_type::NONE;
  std::vector<std::string> names = {};
};

class ControllerInterface : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface
{
public:
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_init() = 0;
  virtual return_type update(const rclcpp::Time & time, const rclcpp::Duration & period) = 0;
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() { return node_; }
  std::shared_ptr<const rclcpp_lifecycle::LifecycleNode> get_node() const { return node_; }
  unsigned int get_update_rate() const { return update_rate; }
  void assign_interfaces(
    std::vector<hardware_interface::LoanedCommandInterface> && commands,
    std::vector<hardware_interface::LoanedStateInterface> && states)
  {
    command_interfaces_ = std::move(commands);
    state_interfaces_ = std::move(states);
  }
  template <typename ParameterT>
  auto auto_declare(const std::string & name, const ParameterT & default_value)
  {
    return get_node()->has_parameter(name) ?
           get_node()->get_parameter(name).get_value<ParameterT>() :
           get_node()->declare_parameter<ParameterT>(name, default_value);
  }
  unsigned int update_rate = 0;

protected:
  std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
  std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;

private:
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_ =
    std::make_shared<rclcpp_lifecycle::LifecycleNode>();
};
}  // namespace controller_interface

#endif  // STAND_IN_HPP_
