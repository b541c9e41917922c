// Tests of the core in C++, with every access checked: built with the address and undefined-behaviour
// sanitizers.

#include <stdint.h>
#include <string.h>

#include <random>
#include <vector>

#include "board.h"
#include "check.h"
#include "frame_receiver.h"
#include "framing.h"
#include "hal_crc.h"
#include "path_clock.h"
#include "reader.h"
#include "segment.h"

namespace {

using planarm::FrameReceiver;
using planarm::Move;
using planarm::Reader;
namespace wire = planarm::wire;

using Bytes = std::vector<uint8_t>;

std::mt19937 random_bits(1);  // the same sequence at every run

uint32_t random_below(uint32_t end) { return static_cast<uint32_t>(random_bits() % end); }

uint16_t crc_of(const Bytes& bytes, uint16_t initial) {
    uint16_t crc = initial;
    for (uint8_t byte : bytes) crc = hal::crc_update(crc, byte);
    return crc;
}

// The checksum bit by bit, as its definition says.
uint16_t plain_crc(const Bytes& bytes, uint16_t crc) {
    for (uint8_t byte : bytes) {
        crc = static_cast<uint16_t>(crc ^ byte);
        for (int bit = 0; bit < 8; ++bit)
            crc = static_cast<uint16_t>((crc >> 1) ^ ((crc & 1) != 0 ? 0x8408 : 0));
    }
    return crc;
}

void append_crc(Bytes& bytes, uint16_t crc) {
    bytes.push_back(static_cast<uint8_t>(crc));
    bytes.push_back(static_cast<uint8_t>(crc >> 8));
}

Bytes encode(uint8_t seq, uint8_t type, const Bytes& payload) {
    Bytes body = {static_cast<uint8_t>(payload.size()), seq, type};
    const uint16_t header_crc = crc_of(body, wire::CRC_INITIAL);
    append_crc(body, header_crc);
    body.insert(body.end(), payload.begin(), payload.end());
    if (!payload.empty()) append_crc(body, crc_of(payload, header_crc));
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

Bytes random_bytes(size_t most) {
    Bytes bytes(random_below(static_cast<uint32_t>(most + 1)));
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random_bits());
    return bytes;
}

// The events of a line that comes in pieces of any length.
std::vector<FrameReceiver::Event> events(FrameReceiver& receiver, const Bytes& line) {
    std::vector<FrameReceiver::Event> found;
    size_t at = 0;
    while (at < line.size()) {
        const size_t left = line.size() - at;
        const uint8_t piece =
            static_cast<uint8_t>(1 + random_below(left < 20 ? static_cast<uint32_t>(left) : 20));
        size_t used = 0;
        while (used < piece) {
            const FrameReceiver::Received received =
                receiver.receive(line.data() + at + used, static_cast<uint8_t>(piece - used));
            used += received.bytes;
            if (received.event != FrameReceiver::Event::NONE) found.push_back(received.event);
        }
        at += used;
    }
    return found;
}

FrameReceiver::Event last_event(FrameReceiver& receiver, const Bytes& line) {
    const std::vector<FrameReceiver::Event> found = events(receiver, line);
    return found.empty() ? FrameReceiver::Event::NONE : found.back();
}

constexpr planarm_delays DELAYS = {600, 60, 0, 0, 120};

void power_on() { planarm_power_on(7, 0, DELAYS); }

void send(const Bytes& line) {
    planarm_receive(line.data(), line.size());
    planarm_run(40000);
}

bool anything_stepped() {
    planarm_edge edge;
    bool stepped = false;
    while (planarm_take_edges(&edge, 1) != 0) stepped = stepped || edge.pin != wire::ENABLE_PIN;
    return stepped;
}

// A speeding up is held against its law, s0 <= s1 + F D s1^3, in floating point.
CASE(a_speeding_up_keeps_to_its_allowance_and_never_turns_into_a_slowing) {
    using planarm::path_clock::ONE;
    for (int i = 0; i < 200000; ++i) {
        const uint32_t stretch = ONE + random_below(i % 2 == 0 ? 3 * ONE : 255 * ONE);
        const uint32_t target = ONE + random_below(stretch - ONE + 1);
        const uint16_t path_ticks = static_cast<uint16_t>(1 + random_below(wire::SLICE_TICKS));
        const uint8_t code = static_cast<uint8_t>(random_below(256));
        const uint32_t rate = planarm::path_clock::rate_value(code) >> 1;
        const uint32_t end =
            planarm::path_clock::stretch_after(stretch, {path_ticks, false, true, target, {0, code}});
        CHECK(end >= target && end <= stretch);
        const double s1 = end / 65536.0;
        const double lawful = s1 + rate / 4294967296.0 * path_ticks * s1 * s1 * s1;
        CHECK(stretch / 65536.0 <= lawful * 1.0001 + 0.0001);
    }
}

// By the gentlest rates, too: the clock must come back to its pace.
CASE(a_speeding_up_uses_nearly_all_of_its_allowance) {
    using planarm::path_clock::ONE;
    for (int i = 0; i < 20000; ++i) {
        const uint32_t stretch = ONE + random_below(3 * ONE);
        const uint16_t path_ticks = static_cast<uint16_t>(1 + random_below(wire::SLICE_TICKS));
        const uint8_t code = static_cast<uint8_t>(random_below(256));
        const uint32_t end =
            planarm::path_clock::stretch_after(stretch, {path_ticks, false, false, ONE, {0, code}});
        const double s0 = stretch / 65536.0;
        const double allowed = planarm::path_clock::rate_value(code) / 4294967296.0 * path_ticks;
        if (allowed * s0 * s0 > 0.2) continue;
        double lawful = s0;  // the root of s + F D s^3 = s0
        for (int turn = 0; turn < 100; ++turn) lawful = s0 - allowed * lawful * lawful * lawful;
        if (lawful < 1) lawful = 1;
        CHECK(s0 - end / 65536.0 >= 0.95 * (s0 - lawful) - 8 / 65536.0);
    }
}

}  // namespace

CASE(crc_has_the_check_value) {
    const char* digits = "123456789";
    CHECK(crc_of(Bytes(digits, digits + 9), wire::CRC_INITIAL) == 0x6F91);
}

CASE(crc_equals_its_definition) {
    for (int i = 0; i < 200; ++i) {
        const Bytes bytes = random_bytes(60);
        const uint16_t initial = static_cast<uint16_t>(random_bits());
        CHECK(crc_of(bytes, initial) == plain_crc(bytes, initial));
    }
}

CASE(reader_takes_numbers_in_their_shortest_form_only) {
    const struct {
        Bytes bytes;
        bool good;
        uint32_t value;
    } cases[] = {
        {{0x00}, true, 0},
        {{0x7F}, true, 127},
        {{0x80, 0x01}, true, 128},
        {{0xFF, 0xFF, 0xFF, 0xFF, 0x0F}, true, 0xFFFFFFFF},
        {{0xFF, 0xFF, 0xFF, 0xFF, 0x1F}, false, 0},
        {{0xFF, 0xFF, 0xFF, 0xFF, 0x8F, 0x00}, false, 0},
        {{0x80, 0x00}, false, 0},
        {{0x80}, false, 0},
        {{}, false, 0},
    };
    for (const auto& item : cases) {
        Reader reader;
        reader.begin(item.bytes.data(), static_cast<uint8_t>(item.bytes.size()));
        CHECK(reader.varuint() == item.value);
        CHECK(reader.ok() == item.good);
    }
}

CASE(reader_undoes_zigzag) {
    const Bytes bytes = {0x00, 0x01, 0x02, 0xFE, 0xFF, 0xFF, 0xFF, 0x0F, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F};
    Reader reader;
    reader.begin(bytes.data(), static_cast<uint8_t>(bytes.size()));
    const int32_t expected[] = {0, -1, 1, INT32_MAX, INT32_MIN};
    for (int32_t value : expected) CHECK(reader.varint() == value);
    CHECK(reader.ok() && reader.at_end());
}

CASE(receiver_takes_every_frame_that_is_sound) {
    FrameReceiver receiver;
    receiver.reset();
    for (int i = 0; i < 500; ++i) {
        const Bytes payload = random_bytes(wire::MAX_PAYLOAD_BYTES);
        const uint8_t seq = static_cast<uint8_t>(random_bits());
        const uint8_t type = static_cast<uint8_t>(random_bits());
        CHECK(last_event(receiver, encode(seq, type, payload)) == FrameReceiver::Event::FRAME);
        const planarm::Frame frame = receiver.frame();
        CHECK(frame.seq == seq && frame.type == type && frame.length == payload.size());
        CHECK(payload.empty() || memcmp(frame.payload, payload.data(), payload.size()) == 0);
    }
}

CASE(receiver_finds_every_single_damaged_bit) {
    FrameReceiver receiver;
    receiver.reset();
    const Bytes line = encode(5, 4, {1, 2, 0x7E, 4, 0x7D, 6});
    for (size_t bit = 0; bit < 8 * (line.size() - 1); ++bit) {
        Bytes damaged = line;
        damaged[bit / 8] = static_cast<uint8_t>(damaged[bit / 8] ^ (1u << bit % 8));
        for (FrameReceiver::Event event : events(receiver, damaged))
            CHECK(event != FrameReceiver::Event::FRAME);
        CHECK(last_event(receiver, line) == FrameReceiver::Event::FRAME);
    }
}

CASE(receiver_takes_no_needless_escape) {
    // 0x7D 0x22 would be 0x02, the type of QUERY, which needs no escape.
    Bytes line = encode(5, 2, {});
    line.insert(line.begin() + 2, wire::ESCAPE);
    line[3] ^= wire::ESCAPE_XOR;
    FrameReceiver receiver;
    receiver.reset();
    CHECK(last_event(receiver, line) == FrameReceiver::Event::DAMAGED);
}

CASE(receiver_takes_no_payload_over_the_limit) {
    FrameReceiver receiver;
    receiver.reset();
    const Bytes longest(wire::MAX_PAYLOAD_BYTES, 1);
    const Bytes too_long(wire::MAX_PAYLOAD_BYTES + 1, 1);
    CHECK(last_event(receiver, encode(5, 2, too_long)) == FrameReceiver::Event::DAMAGED);
    CHECK(last_event(receiver, encode(5, 2, longest)) == FrameReceiver::Event::FRAME);
    CHECK(last_event(receiver, encode(5, 2, Bytes(250, 1))) == FrameReceiver::Event::DAMAGED);
}

CASE(last_tick_of_a_move_is_the_closed_form) {
    for (int i = 0; i < 40000; ++i) {
        const bool slow = i % 2 != 0;
        const uint32_t most_steps = slow ? wire::MAX_COARSE_STEPS : wire::MAX_SEGMENT_STEPS;
        // In a slow move everything counts 2^-8 ticks.
        const int64_t least = slow ? static_cast<int64_t>(wire::MIN_SLOW_INTERVAL_TICKS) << 8
                                   : static_cast<int64_t>(wire::MIN_INTERVAL_TICKS) << 16;
        const int64_t begin = slow ? static_cast<int64_t>(wire::SLOW_INTERVAL_TICKS) << 8 : least;
        const int64_t end = int64_t(1) << 32;
        Move move = {};
        move.slow = slow ? 1 : 0;
        move.count = static_cast<uint16_t>(1 + random_below(most_steps));
        move.interval = static_cast<uint32_t>(
            begin + static_cast<int64_t>(random_bits() % static_cast<uint64_t>(end - begin)));
        const int64_t changes = move.count > 2 ? move.count - 2 : 1;
        const int64_t last = least + static_cast<int64_t>(random_bits() % static_cast<uint64_t>(end - least));
        const int64_t add = (last - move.interval) / changes;
        if (add < INT32_MIN || add > INT32_MAX) continue;
        move.add = static_cast<uint32_t>(static_cast<int32_t>(add));
        const int64_t n = move.count - 1;
        const int64_t closed_form =
            n == 0 ? 0 : (n * move.interval + n * (n - 1) / 2 * add) >> (slow ? 8 : 16);
        CHECK(planarm::run_ticks(move) == closed_form);
    }
}

namespace {

// What a message's payload must have to be more than malformed; any length for those not named.
size_t exact_length(uint8_t type, size_t any) {
    using wire::MessageType;
    switch (static_cast<MessageType>(type)) {
        case MessageType::ENABLE:
            return wire::ENABLE_BYTES;
        case MessageType::START:
            return wire::START_BYTES;
        case MessageType::OVERRIDE:
            return wire::OVERRIDE_BYTES;
        case MessageType::STOP:
            return wire::STOP_BYTES;
        case MessageType::CONFIG:
            return wire::CONFIG_BYTES;
        case MessageType::SOFT_LIMITS:
            return wire::SOFT_LIMITS_BYTES;
        case MessageType::HOME:
            return wire::HOME_BYTES;
        case MessageType::SET_POSITION:
            return wire::SET_POSITION_BYTES;
        case MessageType::QUERY:
        case MessageType::CLEAR:
        case MessageType::RESUME:
            return 0;
        default:
            return any;
    }
}

void begin_session() { send(encode(0, 1, {wire::PROTOCOL_VERSION, 1, 2, 3, 4})); }

void append_number(Bytes& bytes, uint32_t value) {
    for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

}  // namespace

CASE(positions_count_on_over_the_ends_of_their_range) {
    for (bool positive : {true, false}) {
        power_on();
        begin_session();
        Bytes ends;
        for (int joint = 0; joint < 2; ++joint) append_number(ends, positive ? 0x7FFFFFFF : 0x80000000);
        send(encode(1, 0xD, ends));
        send(encode(2, 3, {1}));
        // Three steps of the first joint, 2,000 ticks after each other: the numbers of docs/protocol.md.
        const uint8_t steps_dir = positive ? 7 : 6;
        send(encode(3, 4, {0, 0, 0, 0xC1, 0x9A, 0x0C, steps_dir, 0x64, 0x80, 0xA0, 0x1F, 0x00, 0x00}));
        Bytes lead;
        append_number(lead, wire::MIN_LEAD_TICKS);
        send(encode(4, 5, lead));
        planarm_run(1000000);
        CHECK(anything_stepped());
    }
}

CASE(sound_frames_of_any_content_do_no_harm) {
    power_on();
    begin_session();
    for (int i = 0; i < 3000; ++i) {
        // The firmware may or may not expect this number; about half of the frames are carried out.
        static uint8_t seq = 1;
        Bytes payload = random_bytes(wire::MAX_PAYLOAD_BYTES);
        if (random_below(2) == 0) {
            for (uint8_t& byte : payload) byte &= 0x0F;
        }
        const uint8_t type = static_cast<uint8_t>(random_below(15));
        if (random_below(4) != 0) payload.resize(exact_length(type, payload.size()));
        if (type == 0xA && payload.size() == wire::CONFIG_BYTES && random_below(2) == 0) {
            wire::Config& told = *reinterpret_cast<wire::Config*>(payload.data());
            told.pin_map = wire::PinMap::OWN;
            told.joints = wire::JOINTS;
            told.wake_ticks &= 0xFFFF;
            told.high_ticks = 0;
        }
        send(encode(seq++, type, payload));
        if (random_below(100) == 0) {
            begin_session();
            seq = 1;
            send(encode(seq++, 6, {}));
            send(encode(seq++, 3, {1}));
        }
    }
    uint8_t sent[256];
    CHECK(planarm_take_sent(sent, sizeof sent) > 0);
}

CASE(random_bytes_never_step) {
    power_on();
    begin_session();
    send(encode(1, 3, {1}));
    for (int i = 0; i < 3000; ++i) send(random_bytes(120));
    CHECK(!anything_stepped());
}

int main() { return run_all(); }
