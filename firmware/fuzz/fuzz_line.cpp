// libFuzzer's target: everything that a line and its pins can bring to the firmware, with time passing in
// between.
//
// An input is a script. Each record begins with a byte: its two low bits tell what follows, the others how
// much.
//   0  that many bytes as they come over the line
//   1  a sound frame with the number that the device expects: a type, then that many payload bytes
//   2  time: a count of 16 bits, in units of 64 ticks
//   3  the inputs: limit switches and the stop input
// Whatever happens, a pulse ends before the next begins, high, low and least interval of a joint are kept,
// DIR stands still while STEP is high and long enough before it rises, the ledger is what the pins have made,
// and everything that is sent back is a sound frame.

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <vector>

#include "board.h"
#include "frame_receiver.h"
#include "framing.h"
#include "hal_crc.h"
#include "settings.h"
#include "step_engine.h"
#include "supervisor.h"

namespace {

using planarm::FrameReceiver;
namespace wire = planarm::wire;
using Bytes = std::vector<uint8_t>;

constexpr planarm_delays DELAYS = {600, 60, 0, 0, 16};
constexpr uint64_t MOST_TICKS = 4000000;  // of one input: a quarter of a second
constexpr uint64_t REPLY_TICKS = 40000;
constexpr uint64_t LONG_AGO = UINT64_MAX;

void require(bool holds, const char* what) {
    if (holds) return;
    fprintf(stderr, "broken: %s\n", what);
    abort();
}

uint16_t crc_of(const Bytes& bytes, size_t from, uint16_t crc) {
    for (size_t i = from; i < bytes.size(); ++i) crc = hal::crc_update(crc, bytes[i]);
    return crc;
}

void append_crc(Bytes& bytes, uint16_t crc) {
    bytes.push_back(static_cast<uint8_t>(crc));
    bytes.push_back(static_cast<uint8_t>(crc >> 8));
}

Bytes line_of(uint8_t seq, uint8_t type, const Bytes& payload) {
    Bytes body = {static_cast<uint8_t>(payload.size()), seq, type};
    const uint16_t header_crc = crc_of(body, 0, wire::CRC_INITIAL);
    append_crc(body, header_crc);
    const size_t begin = body.size();
    body.insert(body.end(), payload.begin(), payload.end());
    if (!payload.empty()) append_crc(body, crc_of(body, begin, header_crc));
    Bytes line;
    for (uint8_t byte : body) {
        if (planarm::is_special(byte)) {
            line.push_back(wire::ESCAPE);
            byte ^= wire::ESCAPE_XOR;
        }
        line.push_back(byte);
    }
    line.push_back(wire::DELIMITER);
    return line;
}

struct Joint {
    bool high = false;
    uint64_t changed = LONG_AGO;
    uint64_t rose = LONG_AGO;
    bool dir_high = false;
    uint64_t turned = LONG_AGO;
    int32_t steps = 0;  // with DIR high less those with DIR low, since the last look
    int32_t later = 0;  // the same, behind the moment that the position is told for
    int32_t told = 0;   // the ledger at that look
};

bool is_apart(uint64_t earlier, uint64_t later, uint64_t ticks) {
    return earlier == LONG_AGO || later - earlier >= ticks;
}

// What is seen from outside: the pins and the line back.
class Witness {
  public:
    Witness() {
        receiver_.reset();
        to_device_.reset();
    }

    uint8_t expected_seq() const { return expected_seq_; }

    // What is brought to the device: SET_POSITION may come in it.
    void note(const Bytes& line) {
        for (uint8_t byte : line) {
            if (to_device_.receive(&byte, 1).event != FrameReceiver::Event::FRAME) continue;
            if (to_device_.frame().type == static_cast<uint8_t>(wire::MessageType::SET_POSITION))
                told_ = true;
        }
    }

    // The position first: to ask for it takes time, in which a step may rise.
    void look() {
        const uint64_t begun = planarm_now();
        const planarm::step_engine::Position position = planarm::step_engine::position();
        const uint16_t later = static_cast<uint16_t>(position.counter - static_cast<uint16_t>(begun));
        planarm_edge edge;
        while (planarm_take_edges(&edge, 1) != 0) see(edge, edge.tick > begun + later);
        uint8_t byte;
        while (planarm_take_sent(&byte, 1) != 0) hear(byte);
        compare_ledger(position);
    }

  private:
    void see(const planarm_edge& edge, bool is_later) {
        for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
            Joint& seen = joints_[joint];
            if (edge.pin == wire::DIR_PINS[joint]) {
                require(!seen.high, "DIR changed while STEP was high");
                seen.dir_high = edge.level != 0;
                seen.turned = edge.tick;
            }
            if (edge.pin != wire::STEP_PINS[joint]) continue;
            require((edge.level != 0) != seen.high, "STEP rose or fell twice");
            const uint64_t least = seen.high ? wire::MIN_STEP_HIGH_TICKS : wire::MIN_STEP_LOW_TICKS;
            require(is_apart(seen.changed, edge.tick, least), "STEP high or low for too short a time");
            seen.high = edge.level != 0;
            seen.changed = edge.tick;
            if (!seen.high) continue;
            require(is_apart(seen.rose, edge.tick, wire::MIN_INTERVAL_TICKS),
                    "two steps nearer than the least interval");
            require(is_apart(seen.turned, edge.tick, wire::MIN_DIR_SETUP_TICKS), "DIR too late for STEP");
            seen.rose = edge.tick;
            (is_later ? seen.later : seen.steps) += seen.dir_high ? 1 : -1;
        }
    }

    // Every step is counted, but for an emergency stop, which loses the position, and SET_POSITION.
    void compare_ledger(const planarm::step_engine::Position& position) {
        const wire::Fault fault = planarm::supervisor::fault();
        const bool lost = fault == wire::Fault::EMERGENCY_STOP || fault == wire::Fault::STOP_INPUT;
        for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
            Joint& seen = joints_[joint];
            const bool inverted = (planarm::settings::config.dir_inverted >> joint & 1) != 0;
            const int32_t made = inverted ? -seen.steps : seen.steps;
            require(lost || told_ || position.usteps[joint] - seen.told == made,
                    "the ledger is not what the pins have made");
            seen.told = position.usteps[joint];
            seen.steps = seen.later;
            seen.later = 0;
        }
        told_ = false;
    }

    void hear(uint8_t byte) {
        const FrameReceiver::Event event = receiver_.receive(&byte, 1).event;
        require(event != FrameReceiver::Event::DAMAGED, "a damaged frame was sent");
        if (event == FrameReceiver::Event::FRAME) expected_seq_ = receiver_.frame().seq;
    }

    Joint joints_[wire::JOINTS];
    FrameReceiver receiver_;
    FrameReceiver to_device_;
    bool told_ = false;
    uint8_t expected_seq_ = 0;
};

class Script {
  public:
    Script(const uint8_t* data, size_t size) : at_(data), end_(data + size) {}

    bool at_end() const { return at_ == end_; }
    uint8_t byte() { return at_ == end_ ? static_cast<uint8_t>(0) : *at_++; }
    Bytes bytes(size_t most) {
        const size_t left = static_cast<size_t>(end_ - at_);
        const Bytes found(at_, at_ + (most < left ? most : left));
        at_ += found.size();
        return found;
    }

  private:
    const uint8_t* at_;
    const uint8_t* end_;
};

void bring(const Bytes& line, Witness& witness) {
    witness.note(line);
    planarm_receive(line.data(), line.size());
    planarm_run(REPLY_TICKS);
    witness.look();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    planarm_power_on(7, 0, DELAYS);
    Witness witness;
    bring(line_of(0, static_cast<uint8_t>(wire::MessageType::HELLO), {wire::PROTOCOL_VERSION, 1, 2, 3, 4}),
          witness);
    Script script(data, size);
    while (!script.at_end() && planarm_now() < MOST_TICKS) {
        const uint8_t record = script.byte();
        const size_t most = record >> 2;
        switch (record & 3) {
            case 0:
                bring(script.bytes(most), witness);
                break;
            case 1: {
                const uint8_t type = script.byte();
                const Bytes payload =
                    script.bytes(most < wire::MAX_PAYLOAD_BYTES ? most : wire::MAX_PAYLOAD_BYTES);
                bring(line_of(witness.expected_seq(), type, payload), witness);
                break;
            }
            case 2: {
                const uint8_t low = script.byte();
                planarm_run(64u * (low + 256u * script.byte()));
                witness.look();
                break;
            }
            default:
                planarm_set_inputs(script.byte());
                planarm_run(600);
                witness.look();
        }
    }
    return 0;
}
