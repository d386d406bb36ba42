// Plays a motion of `proprio excite` on a Unitree Go2 and records a log. Documentation: read examples/README.md first.
//
//     g++ -std=c++17 -O2 play_motion.cpp -lunitree_sdk2 -lddscxx -lddsc -lpthread -o play_motion
//     ./play_motion eth0 motion.csv log.csv 0.2

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <unitree/idl/go2/LowCmd_.hpp>
#include <unitree/idl/go2/LowState_.hpp>
#include <unitree/robot/channel/channel_publisher.hpp>
#include <unitree/robot/channel/channel_subscriber.hpp>

using Command = unitree_go::msg::dds_::LowCmd_;
using State = unitree_go::msg::dds_::LowState_;
using Clock = std::chrono::steady_clock;

static const char* const kJoints[12] = {"FR_hip", "FR_thigh", "FR_calf", "FL_hip", "FL_thigh", "FL_calf",
                                        "RR_hip", "RR_thigh", "RR_calf", "RL_hip", "RL_thigh", "RL_calf"};
static const double kLower[3] = {-1.0472, -1.5708, -2.7227};
static const double kUpper[3] = {1.0472, 4.5379, -0.83776};
static const double kPeriod = 0.002, kRamp = 3.0, kHold = 1.0, kSoftStop = 1.0;  // s
static const double kStale = 0.02, kAstray = 0.4, kHot = 75.0;                   // s, rad, degrees Celsius
static const double kDamping = 2.0;                                               // N m s/rad

static std::atomic<bool> stop{false};

struct Motion {
    std::vector<int> moved;                                  // motors that it moves
    std::vector<std::map<std::string, double>> rows;         // by column
    double at(size_t row, const char* channel, int motor) const {
        return rows[row].at(std::string(channel) + "/" + kJoints[motor]);
    }
};

static Motion read(const char* path) {
    Motion motion;
    std::ifstream file(path);
    std::string line, cell;
    std::vector<std::string> names;
    std::getline(file, line);
    for (std::stringstream header(line); std::getline(header, cell, ',');) names.push_back(cell);
    while (std::getline(file, line)) {
        std::map<std::string, double> row;
        std::stringstream cells(line);
        for (const auto& name : names) {
            std::getline(cells, cell, ',');
            row[name] = std::stod(cell);
        }
        motion.rows.push_back(row);
    }
    for (int motor = 0; motor < 12; ++motor)
        if (motion.rows.at(0).count(std::string("q/") + kJoints[motor])) motion.moved.push_back(motor);
    return motion;
}

// The SDK's checksum of a command: CRC-32 (polynomial 0x04C11DB7, not reflected) over its 32-bit words but the last.
static uint32_t checksum(const uint32_t* words, size_t count) {
    uint32_t crc = 0xFFFFFFFF;
    for (size_t n = 0; n < count; ++n)
        for (uint32_t bit = 1u << 31; bit; bit >>= 1) {
            const bool top = crc & 0x80000000;
            crc <<= 1;
            if (top != bool(words[n] & bit)) crc ^= 0x04C11DB7;
        }
    return crc;
}

class Robot {
  public:
    explicit Robot(const char* interface)
        : publisher_("rt/lowcmd"), subscriber_("rt/lowstate") {
        unitree::robot::ChannelFactory::Instance()->Init(0, interface);
        publisher_.InitChannel();
        subscriber_.InitChannel([this](const void* message) {
            std::lock_guard<std::mutex> lock(mutex_);
            state_ = *static_cast<const State*>(message);
            stamp_ = Clock::now();
            seen_ = true;
        }, 1);
        command_.head()[0] = 0xFE;
        command_.head()[1] = 0xEF;
        command_.level_flag() = 0xFF;
        for (auto& motor : command_.motor_cmd()) {
            motor.mode() = 0x01;
            motor.q() = 2.146e9f;      // the SDK's "no position"
            motor.dq() = 16000.0f;     // and "no velocity"
        }
    }
    bool latest(State& state, double& age) {
        std::lock_guard<std::mutex> lock(mutex_);
        state = state_;
        age = std::chrono::duration<double>(Clock::now() - stamp_).count();
        return seen_;
    }
    void set(int motor, double q, double dq, double kp, double kd, double tau) {
        auto& m = command_.motor_cmd()[motor];
        m.q() = q, m.dq() = dq, m.kp() = kp, m.kd() = kd, m.tau() = tau;
    }
    void publish() {
        command_.crc() = checksum(reinterpret_cast<const uint32_t*>(&command_), sizeof(Command) / 4 - 1);
        publisher_.Write(command_);
    }

  private:
    unitree::robot::ChannelPublisher<Command> publisher_;
    unitree::robot::ChannelSubscriber<State> subscriber_;
    Command command_{};
    State state_{};
    Clock::time_point stamp_{};
    bool seen_ = false;
    std::mutex mutex_;
};

// Why to stop, or nothing.
static std::string fault(const State& state, double age, const Motion& motion, const std::vector<double>& wanted) {
    if (age > kStale) return "the state is old";
    for (size_t n = 0; n < motion.moved.size(); ++n) {
        const int motor = motion.moved[n];
        const auto& m = state.motor_state()[motor];
        // Asked so that what is not a number stops too.
        if (!(std::abs(m.q() - wanted[n]) <= kAstray)) return std::string(kJoints[motor]) + " is astray";
        if (!(m.q() >= kLower[motor % 3] - 0.02 && m.q() <= kUpper[motor % 3] + 0.02))
            return std::string(kJoints[motor]) + " is beyond its limits";
        if (m.temperature() > kHot) return std::string(kJoints[motor]) + " is hot";
    }
    return "";
}

int main(int argc, char** argv) {
    // Share of the motion about its first pose; a larger motion than the one designed would be beyond the limits.
    const double scale = argc == 5 ? std::atof(argv[4]) : 1.0;
    if (argc < 4 || argc > 5 || !(scale > 0.0 && scale <= 1.0)) {
        std::cerr << "usage: play_motion INTERFACE MOTION.csv LOG.csv [SCALE, above 0 and at most 1]\n";
        return 2;
    }
    // A smaller motion needs less torque by an unknown amount: feed-forward only at full size.
    const double forward = scale == 1.0 ? 1.0 : 0.0;
    std::signal(SIGINT, [](int) { stop = true; });
    const Motion motion = read(argv[2]);
    Robot robot(argv[1]);
    State state;
    double age = 0.0;
    while (!robot.latest(state, age)) std::this_thread::sleep_for(std::chrono::milliseconds(100));

    std::vector<double> here, wanted;
    for (int motor : motion.moved) here.push_back(state.motor_state()[motor].q());
    wanted = here;
    FILE* log = std::fopen(argv[3], "w");
    std::fprintf(log, "t");
    for (const char* channel : {"q", "dq", "tau", "q_des"})
        for (int motor : motion.moved) std::fprintf(log, ",%s/%s", channel, kJoints[motor]);
    std::fprintf(log, "\n");

    const auto begun = Clock::now();
    auto next = begun;
    uint32_t last = 0;
    while (!stop) {
        const double t = std::chrono::duration<double>(Clock::now() - begun).count();
        const double played = t - kRamp - kHold;
        const size_t row = played > 0.0 ? std::lround(played / kPeriod) : 0;
        if (row >= motion.rows.size()) break;
        for (size_t n = 0; n < motion.moved.size(); ++n) {
            const int motor = motion.moved[n];
            const double share = 0.5 - 0.5 * std::cos(M_PI * std::min(t / kRamp, 1.0));
            const double first = motion.at(0, "q", motor);
            const bool plays = played > 0.0;
            wanted[n] = plays ? first + scale * (motion.at(row, "q", motor) - first) : here[n] + (first - here[n]) * share;
            robot.set(motor, wanted[n], plays ? scale * motion.at(row, "dq", motor) : 0.0, motion.at(row, "kp", motor),
                      motion.at(row, "kd", motor), plays ? forward * motion.at(row, "tau", motor) : 0.0);
        }
        robot.latest(state, age);
        const std::string why = fault(state, age, motion, wanted);
        if (!why.empty()) {
            std::cerr << "stopping: " << why << "\n";
            break;
        }
        robot.publish();
        // A state that was seen already is no new sample.
        if (played > 0.0 && state.tick() != last) {
            last = state.tick();
            std::fprintf(log, "%.3f", last * 1e-3);
            for (int motor : motion.moved) std::fprintf(log, ",%.7f", state.motor_state()[motor].q());
            for (int motor : motion.moved) std::fprintf(log, ",%.7f", state.motor_state()[motor].dq());
            for (int motor : motion.moved) std::fprintf(log, ",%.7f", state.motor_state()[motor].tau_est());
            for (double q : wanted) std::fprintf(log, ",%.7f", q);
            std::fprintf(log, "\n");
        }
        next += std::chrono::microseconds(2000);
        std::this_thread::sleep_until(next);
    }
    std::fclose(log);
    // Soft stop: from position control to damping alone, then damping for as long again.
    for (double t = 0.0; t < 2 * kSoftStop; t += kPeriod) {
        const double share = std::max(0.0, 1.0 - t / kSoftStop);
        for (size_t n = 0; n < motion.moved.size(); ++n) {
            const int motor = motion.moved[n];
            robot.set(motor, wanted[n], 0.0, share * motion.at(0, "kp", motor), kDamping, 0.0);
        }
        robot.publish();
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
}
