// libFuzzer's target: everything that a line and its pins can bring to the firmware, with time passing in
// between.
//
// An input is a script. Each record begins with a byte: its two low bits tell what follows, the others how
// much.
//   0  that many bytes as they come over the line
//   1  a sound frame with the number that the device expects: a type, then that many payload bytes
//   2  time: a count of 16 bits, in units of 64 ticks
//   3  the inputs: limit switches and the stop input
// Whatever happens, a pulse ends before the next begins, rising edges of a joint keep the least interval, DIR
// stands still while STEP is high, and everything that is sent back is a sound frame.

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <vector>

#include "board.h"
#include "frame_receiver.h"
#include "framing.h"
#include "hal_crc.h"

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
    uint64_t rose = LONG_AGO;
};

// What is seen from outside: the pins and the line back.
class Witness {
  public:
    Witness() { receiver_.reset(); }

    uint8_t expected_seq() const { return expected_seq_; }

    void look() {
        planarm_edge edge;
        while (planarm_take_edges(&edge, 1) != 0) see(edge);
        uint8_t byte;
        while (planarm_take_sent(&byte, 1) != 0) hear(byte);
    }

  private:
    void see(const planarm_edge& edge) {
        for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
            Joint& seen = joints_[joint];
            if (edge.pin == wire::DIR_PINS[joint]) require(!seen.high, "DIR changed while STEP was high");
            if (edge.pin != wire::STEP_PINS[joint]) continue;
            require((edge.level != 0) != seen.high, "STEP rose or fell twice");
            seen.high = edge.level != 0;
            if (!seen.high) continue;
            require(seen.rose == LONG_AGO || edge.tick - seen.rose >= wire::MIN_INTERVAL_TICKS,
                    "two steps nearer than the least interval");
            seen.rose = edge.tick;
        }
    }

    void hear(uint8_t byte) {
        const FrameReceiver::Event event = receiver_.receive(&byte, 1).event;
        require(event != FrameReceiver::Event::DAMAGED, "a damaged frame was sent");
        if (event == FrameReceiver::Event::FRAME) expected_seq_ = receiver_.frame().seq;
    }

    Joint joints_[wire::JOINTS];
    FrameReceiver receiver_;
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
