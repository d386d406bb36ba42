// Pinocchio's side of the duel (studies/duel/run): computes what it is told on standard input and says it on standard output.
//
//   robot BODIES        then a line for each body: the body that carries it (-1: the world), its joint (free, x, y or z: the
//                       axis), where the joint is in its parent (m), m, hx, hy, hz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz
//   states N            then a line for each: for a free base its position (m) and quaternion (w x y z); q, v, a, tau
//   values WORK STATE   the numbers that WORK gives in that state, matrices row-major
//   time WORK ROUNDS    ns of a call, the mean over all states ROUNDS times
//
// WORK is regressor, inverse, inertia or forward. A free base's six coordinates are angular first, as proprio has them.

#include <pinocchio/multibody.hpp>

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <chrono>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace pin = pinocchio;
using Eigen::VectorXd;
using Eigen::Vector3d;

// proprio's inertial parameters by Pinocchio's places, which has Iyy before Ixz; the permutation is its own inverse.
static const int PARAMETER[10] = {0, 1, 2, 3, 4, 5, 7, 6, 8, 9};

template <class Number>
static Number next() {
  Number value;
  if (!(std::cin >> value)) throw std::runtime_error("the input ends early");
  return value;
}

// Keeps the compiler from leaving out work whose result nobody reads.
static void keep(const void* result) { asm volatile("" : : "r"(result) : "memory"); }

struct State {
  VectorXd q, v, a, tau;
};

struct Duel {
  pin::Model model;
  std::unique_ptr<pin::Data> data;
  // Where proprio's velocity coordinates stand in Pinocchio's.
  std::vector<int> coordinates;
  std::vector<State> states;
  bool free = false;

  explicit Duel(int bodies) {
    model.gravity.linear() = Vector3d(0, 0, -9.81);
    for (int body = 0; body < bodies; ++body) {
      const int parent = next<int>() + 1;
      const auto kind = next<std::string>();
      Vector3d place;
      for (double& x : place) x = next<double>();
      Eigen::Matrix<double, 10, 1> parameters;
      for (int k : PARAMETER) parameters[k] = next<double>();
      const pin::SE3 placement(Eigen::Matrix3d::Identity(), place);
      const std::string name = "joint" + std::to_string(body);
      pin::JointIndex joint;
      if (kind == "free") {
        joint = model.addJoint(parent, pin::JointModelFreeFlyer(), placement, name);
        for (int n = 0; n < 6; ++n) coordinates.push_back((n + 3) % 6);
        free = true;
      } else {
        if (kind == "x")
          joint = model.addJoint(parent, pin::JointModelRX(), placement, name);
        else if (kind == "y")
          joint = model.addJoint(parent, pin::JointModelRY(), placement, name);
        else if (kind == "z")
          joint = model.addJoint(parent, pin::JointModelRZ(), placement, name);
        else
          throw std::runtime_error("no such joint: " + kind);
        coordinates.push_back(model.joints[joint].idx_v());
      }
      model.appendBodyToJoint(joint, pin::Inertia::FromDynamicParameters(parameters), pin::SE3::Identity());
    }
    data = std::make_unique<pin::Data>(model);
  }

  void read(int count) {
    states.clear();
    for (int n = 0; n < count; ++n) {
      State state{VectorXd::Zero(model.nq), VectorXd(model.nv), VectorXd(model.nv), VectorXd(model.nv)};
      if (free) {
        for (int i : {0, 1, 2, 6, 3, 4, 5}) state.q[i] = next<double>();
      }
      for (int c : coordinates)
        if (!free || c >= 6) state.q[c + model.nq - model.nv] = next<double>();
      for (VectorXd* part : {&state.v, &state.a, &state.tau})
        for (int c : coordinates) (*part)[c] = next<double>();
      states.push_back(state);
    }
  }

  void regressor(const State& s) { keep(pin::computeJointTorqueRegressor(model, *data, s.q, s.v, s.a).data()); }
  void inverse(const State& s) { keep(pin::rnea(model, *data, s.q, s.v, s.a).data()); }
  void inertia(const State& s) { keep(pin::crba(model, *data, s.q).data()); }
  void forward(const State& s) { keep(pin::aba(model, *data, s.q, s.v, s.tau).data()); }

  template <class Work>
  double time(int rounds, Work work) {
    const auto start = std::chrono::steady_clock::now();
    for (int round = 0; round < rounds; ++round)
      for (const State& state : states) work(state);
    const std::chrono::duration<double, std::nano> span = std::chrono::steady_clock::now() - start;
    return span.count() / rounds / states.size();
  }

  double time(const std::string& work, int rounds) {
    if (work == "regressor") return time(rounds, [this](const State& s) { regressor(s); });
    if (work == "inverse") return time(rounds, [this](const State& s) { inverse(s); });
    if (work == "inertia") return time(rounds, [this](const State& s) { inertia(s); });
    if (work == "forward") return time(rounds, [this](const State& s) { forward(s); });
    throw std::runtime_error("no such work: " + work);
  }

  void values(const std::string& work, int n) {
    const State& s = states.at(n);
    if (work == "regressor") {
      regressor(s);
      for (int c : coordinates)
        for (int column = 0; column < data->jointTorqueRegressor.cols(); ++column)
          std::cout << data->jointTorqueRegressor(c, column - column % 10 + PARAMETER[column % 10]) << ' ';
    } else if (work == "inertia") {
      inertia(s);
      // Pinocchio fills the upper triangle.
      for (int r : coordinates)
        for (int c : coordinates) std::cout << data->M(std::min(r, c), std::max(r, c)) << ' ';
    } else if (work == "inverse") {
      inverse(s);
      for (int c : coordinates) std::cout << data->tau[c] << ' ';
    } else if (work == "forward") {
      forward(s);
      for (int c : coordinates) std::cout << data->ddq[c] << ' ';
    } else {
      throw std::runtime_error("no such work: " + work);
    }
    std::cout << std::endl;
  }
};

int main() try {
  std::cout.precision(17);
  std::unique_ptr<Duel> duel;
  std::string command;
  while (std::cin >> command) {
    if (command == "robot") {
      duel = std::make_unique<Duel>(next<int>());
    } else if (command == "states" && duel) {
      duel->read(next<int>());
    } else if (command == "values" && duel) {
      const auto work = next<std::string>();
      duel->values(work, next<int>());
    } else if (command == "time" && duel) {
      const auto work = next<std::string>();
      std::cout << duel->time(work, next<int>()) << std::endl;
    } else {
      throw std::runtime_error("no such command: " + command);
    }
  }
  return 0;
} catch (const std::exception& error) {
  std::cerr << "pinocchio: " << error.what() << std::endl;
  return 1;
}
