// The wire's numbers and codes. docs/protocol.md tells the rules around them.
//
// Generated from protocol/messages.toml by `python -m planarm_wire.generate`; do not edit.
#pragma once

#include <stdint.h>

#include "wiring.h"

namespace planarm {
namespace wire {

// Both ends must have the same.
constexpr uint8_t PROTOCOL_VERSION = 2;
// Of the specification without its wording.
constexpr uint32_t SPEC_HASH = 0xBDC44704UL;

// Ends every frame.
constexpr uint8_t DELIMITER = 0x7E;
// Announces an escaped byte.
constexpr uint8_t ESCAPE = 0x7D;
// An escaped byte is its code xor this.
constexpr uint8_t ESCAPE_XOR = 0x20;
// Never inside a frame; receivers drop them.
constexpr uint8_t RESERVED[2] = {0x7B, 0x7C};
// Out of band: slows down along the path and rests there; RESUME goes on. Ends a homing.
constexpr uint8_t HOLD_CODE = 0x7B;
// In a row.
constexpr uint8_t HOLD_REPEATS = 1;
// Out of band: ends all pulses at once. The position is lost. A real emergency stop cuts the
// motors' supply.
constexpr uint8_t EMERGENCY_CODE = 0x7C;
// In a row.
constexpr uint8_t EMERGENCY_REPEATS = 3;
// CRC-16/MCRF4XX (reflected 0x1021, initial 0xFFFF, no final xor); sent low byte first.
constexpr uint16_t CRC_INITIAL = 0xFFFFU;
// Length, seq and type.
constexpr uint8_t HEADER_BYTES = 3;
// Of each of the two checks.
constexpr uint8_t CRC_BYTES = 2;
// Before stuffing.
constexpr uint8_t MAX_PAYLOAD_BYTES = 64;
// On the line, all stuffed, with delimiter.
constexpr uint8_t MAX_FRAME_BYTES = 143;

// Timer1 and path clock, prescaler 1.
constexpr uint32_t TICKS_HZ = 16000000UL;
// Exact on a 16 MHz Uno (UBRR 7, U2X).
constexpr uint32_t BAUD = 250000UL;
// Receive ring of the firmware.
constexpr uint8_t RX_RING_BYTES = 128;
// Most unacknowledged bytes, as encoded, the host may have in flight.
constexpr uint8_t HOST_WINDOW_BYTES = 112;
// Bytes that each queued SEGMENTS frame takes besides its payload.
constexpr uint8_t QUEUE_FRAME_BYTES = 1;
// Unit of a segment's need, 2.048 ms.
constexpr uint16_t NEED_UNIT_TICKS = 32768U;
// Most by which the device stretches the path clock.
constexpr uint16_t MAX_STRETCH = 4096U;
// Share of slow and fast that hold, stop, resume and override use; quick stop and a starving queue
// use all of slow.
constexpr uint8_t GENTLE_PERCENT = 50;
// Interval of the start-stop speed until CONFIG tells it, 100 steps/s.
constexpr uint32_t DEFAULT_START_STOP_TICKS = 160000UL;
// Least time from ENABLE to the first step until CONFIG tells it, 10 ms.
constexpr uint32_t DEFAULT_WAKE_TICKS = 160000UL;
// The watchdog resets the chip when the main program stands still for so long.
constexpr uint8_t WATCHDOG_MS = 250;
// A limit switch counts when it stays so for this long, 5 ms.
constexpr uint32_t DEBOUNCE_TICKS = 80000UL;
// Least interval of a homing, 4,000 steps/s: its steps are handed over one by one.
constexpr uint16_t MIN_HOMING_TICKS = 4000U;
// Largest interval inside a move that begins with a shorter one than slow_interval_ticks.
constexpr uint16_t MAX_INTERVAL_TICKS = 65535U;
// 4.1 ms; a move of two steps or more that begins with so long an interval is slow, and has limits
// of its own.
constexpr uint32_t SLOW_INTERVAL_TICKS = 65536UL;
// Least interval inside a slow move.
constexpr uint16_t MIN_SLOW_INTERVAL_TICKS = 32768U;
// Largest interval inside a slow move, 1.05 s; longer gaps need a segment of their own.
constexpr uint32_t MAX_SLOW_INTERVAL_TICKS = 16777215UL;
// A move of so many steps or fewer tells its add in 2^-8 ticks; a slow move has no more.
constexpr uint8_t MAX_COARSE_STEPS = 128;
// The device cuts segments into slices of 3.6 ms, the last two alike. With each doubling of the
// stretch they are half as long, the last up to twice. One run of a joint fills a slice at its
// least interval. The path clock's rate changes from slice to slice.
constexpr uint16_t SLICE_TICKS = 57000U;
// Longest segment, about 67 s.
constexpr uint32_t MAX_SEGMENT_TICKS = 1073741823UL;
// Most steps of one joint in one segment.
constexpr uint16_t MAX_SEGMENT_STEPS = 32767U;
// Least lead of START, 3.5 ms, in which the first slice of all joints is prepared.
constexpr uint16_t MIN_LEAD_TICKS = 56000U;
// Path that the queue must hold beyond what a rest needs, 4.1 ms; with less the device slows down.
constexpr uint32_t STARVING_TICKS = 65536UL;
// Least time from a DIR edge to the next rising STEP edge, 20 us.
constexpr uint16_t MIN_DIR_SETUP_TICKS = 320U;

// Type codes of the messages.
enum class MessageType : uint8_t {
    // From the host: Opens a session and starts the sequence. Motion in progress goes on. Answered
    // by WELCOME.
    HELLO = 1,
    // From the host: Asks for STATUS.
    QUERY = 2,
    // From the host: Energises (1) or releases (0) the drivers: idle to ready, ready to idle.
    // Releasing drops queued segments.
    ENABLE = 3,
    // From the host: Appends segments, all or none. A broken limit latches bad_segment. The head
    // holds for all segments of the message. A rate is a code c of the value v = c below 16, else
    // (16 + c mod 16) 2^(c div 16 - 1), and means v 2^-32 a tick: the path clock's rate, 1 when not
    // stretched, may change by that much in each tick.
    SEGMENTS = 4,
    // From the host: Begins the queued motion: the first segment starts lead_ticks from now.
    START = 5,
    // From the host: Clears a latched fault and the refusal and drops the queue. The drivers stay
    // on where the position is known: ready, held, starved and most faults to ready; after
    // emergency_stop, stop_input and homing_failed they are released, to idle; idle stays. Position
    // counters stay.
    CLEAR = 6,
    // From the host: Goes on after a hold, also one that is still slowing down. In any other state
    // it changes nothing.
    RESUME = 7,
    // From the host: Sets the rate of the path clock, for this motion and those after it. The rate
    // changes within the segments' allowances.
    OVERRIDE = 8,
    // From the host: Slows down along the path, then drops the rest of the motion; the position is
    // kept. Answered at once; the stop is over when STATUS tells ready.
    STOP = 9,
    // From the host: Tells the arm's wiring and drivers; only in state idle. Until it comes, and
    // after every reset, the defaults of the limits hold, nothing is inverted, and no input is
    // used.
    CONFIG = 0xA,
    // From the host: Tells where each joint may be, in terms of the ledger's position; segments
    // that leave it latch soft_limit. Refused while segments are queued, which were checked against
    // the limits of before. Least above most: no limit, as after a reset.
    SOFT_LIMITS = 0xB,
    // From the host: Moves one joint to its limit switch and off it again, slowly the second time.
    // Only in state ready, with limit switches watched. The order of the joints is the host's. Ends
    // in ready with the joint on the step at which the switch closed, or in homing_failed. The
    // ledger counts on: the host compares its count at the switch with the switch's place, which
    // tells the steps lost, and sends SET_POSITION.
    HOME = 0xC,
    // From the host: Tells the position of an arm at rest: the ledger counts on from there. Only in
    // idle and ready.
    SET_POSITION = 0xD,
    // From the device: Answers HELLO.
    WELCOME = 0x81,
    // From the device: Answers every frame but HELLO, and every frame that failed its checks. Sent
    // unasked when a motion ends or a fault latches.
    STATUS = 0x82,
};

// What the device is doing.
enum class State : uint8_t {
    // Drivers released, nothing queued; segments are refused.
    IDLE = 0,
    // Drivers enabled, at rest; segments may be queued.
    READY = 1,
    // Executing segments, slowed down while the queue starves; more may be queued.
    RUNNING = 2,
    // Pulses stopped, first fault latched, drivers keep holding. An emergency stop takes the place
    // of a fault that keeps the position, and may release the drivers. CLEAR leads to ready, or to
    // idle where the position is lost.
    FAULT = 3,
    // Slowing down along the path towards a hold.
    HOLDING = 4,
    // At rest on the path after a hold; RESUME goes on, STOP drops the rest.
    HELD = 5,
    // At rest on the path because the queue ran low; goes on by itself when it is filled.
    STARVED = 6,
    // Slowing down along the path; then the rest is dropped and the state is ready.
    STOPPING = 7,
    // Moving one joint to its limit switch.
    HOMING = 8,
};

// Why the device stopped its pulses.
enum class Fault : uint8_t {
    // No fault.
    NONE = 0,
    // A step could not be placed on its tick.
    MISSED_DEADLINE = 1,
    // The segment queue ran empty before the last segment.
    UNDERRUN = 2,
    // A segment broke a limit of the protocol.
    BAD_SEGMENT = 3,
    // Segments arrived after the last segment of a motion.
    QUEUE_MISUSE = 4,
    // An emergency stop came over the line; the position is lost.
    EMERGENCY_STOP = 5,
    // The stop input opened; the position is lost.
    STOP_INPUT = 6,
    // A limit switch closed during a motion; detail tells the joint.
    LIMIT_SWITCH = 7,
    // A segment would leave a joint's soft limits; detail tells the joint.
    SOFT_LIMIT = 8,
    // The limit switch was not found, or did not open again; detail tells the joint.
    HOMING_FAILED = 9,
};

// Why the device last started.
enum class Reset : uint8_t {
    // The chip does not tell, and its memory was in use before: reset line, short loss of power. Or
    // the watchdog, where the main program stood still with interrupts off.
    UNKNOWN = 0,
    // Power came on.
    POWER_ON = 1,
    // The reset line, as when a port is opened.
    EXTERNAL = 2,
    // The supply fell below the brown-out level.
    BROWN_OUT = 3,
    // The main program stood still and the watchdog reset the chip.
    WATCHDOG = 4,
};

// Where the drivers are wired.
enum class PinMap : uint8_t {
    // Own wiring: STEP on the compare outputs D9 and D10.
    OWN = 0,
    // Own wiring as well, for drivers that need longer pulses.
    OWN_SLOW = 2,
    // The Arduino CNC shield as it is: STEP on D2 and D3, by interrupt.
    CNC_SHIELD = 1,
};

// How a command went: 0 done, above 0 send it again, below 0 refused.
enum class Result : int8_t {
    // Done.
    OK = 0,
    // No free slot.
    BUSY = 1,
    // The command does not fit the state.
    WRONG_STATE = -1,
    // The payload does not have the message's form.
    MALFORMED = -2,
    // No such message.
    UNKNOWN_TYPE = -3,
    // A value is outside its limits.
    OUT_OF_RANGE = -4,
    // The protocol version differs.
    VERSION = -5,
};

// Payloads of a fixed layout, byte by byte as they are on the wire.
static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the wire's numbers are little-endian, as here");

// Ledger: 12 bytes with two joints.
constexpr uint8_t LEDGER_BYTES = 4 + 4 * JOINTS;
struct [[gnu::packed, gnu::may_alias]] Ledger {
    uint32_t executed_segments;
    int32_t position_usteps[JOINTS];
};
static_assert(sizeof(Ledger) == LEDGER_BYTES, "as on the wire");

// Hello: 5 bytes.
constexpr uint8_t HELLO_BYTES = 5;
struct [[gnu::packed, gnu::may_alias]] Hello {
    uint8_t protocol_version;
    uint32_t host_nonce;
};
static_assert(sizeof(Hello) == HELLO_BYTES, "as on the wire");

// Query: 0 bytes.
constexpr uint8_t QUERY_BYTES = 0;

// Enable: 1 byte.
constexpr uint8_t ENABLE_BYTES = 1;
struct [[gnu::packed, gnu::may_alias]] Enable {
    uint8_t on;
};
static_assert(sizeof(Enable) == ENABLE_BYTES, "as on the wire");

// Segments: payload of 6 to 64 bytes.
constexpr uint8_t SEGMENTS_MIN_BYTES = 4 + 1 * JOINTS;

// Start: 4 bytes.
constexpr uint8_t START_BYTES = 4;
struct [[gnu::packed, gnu::may_alias]] Start {
    uint32_t lead_ticks;
};
static_assert(sizeof(Start) == START_BYTES, "as on the wire");

// Clear: 0 bytes.
constexpr uint8_t CLEAR_BYTES = 0;

// Resume: 0 bytes.
constexpr uint8_t RESUME_BYTES = 0;

// Override: 1 byte.
constexpr uint8_t OVERRIDE_BYTES = 1;
struct [[gnu::packed, gnu::may_alias]] Override {
    uint8_t percent;
};
static_assert(sizeof(Override) == OVERRIDE_BYTES, "as on the wire");

// Stop: 1 byte.
constexpr uint8_t STOP_BYTES = 1;
struct [[gnu::packed, gnu::may_alias]] Stop {
    uint8_t quick;
};
static_assert(sizeof(Stop) == STOP_BYTES, "as on the wire");

// Config: 22 bytes with two joints.
constexpr uint8_t CONFIG_BYTES = 14 + 4 * JOINTS;
struct [[gnu::packed, gnu::may_alias]] Config {
    PinMap pin_map;
    uint8_t joints;
    uint8_t dir_inverted;
    uint8_t options;
    uint32_t idle_ms;
    uint32_t wake_ticks;
    uint16_t high_ticks;
    uint32_t start_stop_ticks[JOINTS];
};
static_assert(sizeof(Config) == CONFIG_BYTES, "as on the wire");

// SoftLimits: 16 bytes with two joints.
constexpr uint8_t SOFT_LIMITS_BYTES = 8 * JOINTS;
struct [[gnu::packed, gnu::may_alias]] SoftLimits {
    int32_t least_usteps[JOINTS];
    int32_t most_usteps[JOINTS];
};
static_assert(sizeof(SoftLimits) == SOFT_LIMITS_BYTES, "as on the wire");

// Home: 18 bytes.
constexpr uint8_t HOME_BYTES = 18;
struct [[gnu::packed, gnu::may_alias]] Home {
    uint8_t joint;
    uint8_t positive;
    uint32_t fast_ticks;
    uint32_t slow_ticks;
    uint32_t most_usteps;
    uint32_t back_usteps;
};
static_assert(sizeof(Home) == HOME_BYTES, "as on the wire");

// SetPosition: 8 bytes with two joints.
constexpr uint8_t SET_POSITION_BYTES = 4 * JOINTS;
struct [[gnu::packed, gnu::may_alias]] SetPosition {
    int32_t position_usteps[JOINTS];
};
static_assert(sizeof(SetPosition) == SET_POSITION_BYTES, "as on the wire");

// Welcome: 31 bytes with two joints.
constexpr uint8_t WELCOME_BYTES = 23 + 4 * JOINTS;
struct [[gnu::packed, gnu::may_alias]] Welcome {
    uint8_t protocol_version;
    uint32_t host_nonce;
    uint32_t boot_nonce;
    uint32_t spec_hash;
    uint8_t firmware_version[3];
    Reset reset_cause;
    uint8_t interrupted;
    uint8_t joints;
    Ledger ledger;
};
static_assert(sizeof(Welcome) == WELCOME_BYTES, "as on the wire");

// Status: 30 bytes with two joints.
constexpr uint8_t STATUS_BYTES = 22 + 4 * JOINTS;
struct [[gnu::packed, gnu::may_alias]] Status {
    State state;
    Fault fault;
    uint8_t detail;
    Result refusal;
    uint8_t refusal_seq;
    uint16_t free_bytes;
    uint8_t crc_errors;
    uint8_t overruns;
    uint8_t ring_full;
    uint8_t holds;
    uint8_t inputs;
    uint8_t override_percent;
    uint8_t rate_percent;
    uint32_t mcu_ticks;
    Ledger ledger;
};
static_assert(sizeof(Status) == STATUS_BYTES, "as on the wire");

static_assert(HOST_WINDOW_BYTES < RX_RING_BYTES, "a full window fits the receive ring");

}  // namespace wire
}  // namespace planarm
