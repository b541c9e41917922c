// The wire's numbers and codes. docs/protocol.md tells the rules around them.
//
// Generated from protocol/messages.toml by `python -m planarm_wire.generate`; do not edit.
#pragma once

#include <stdint.h>

namespace planarm {
namespace wire {

// Both ends must have the same.
constexpr uint8_t PROTOCOL_VERSION = 1;
// Of the specification without its wording.
constexpr uint32_t SPEC_HASH = 0xD92A41ECUL;

// Ends every frame.
constexpr uint8_t DELIMITER = 0x7E;
// Announces an escaped byte.
constexpr uint8_t ESCAPE = 0x7D;
// An escaped byte is its code xor this.
constexpr uint8_t ESCAPE_XOR = 0x20;
// Never inside a frame; receivers drop them.
constexpr uint8_t RESERVED[2] = {0x7B, 0x7C};
// CRC-16/MCRF4XX (reflected 0x1021, initial 0xFFFF, no final xor); sent low byte first.
constexpr uint16_t CRC_INITIAL = 0xFFFFU;
// Length, seq and type.
constexpr uint8_t HEADER_BYTES = 3;
// Of each of the two checks.
constexpr uint8_t CRC_BYTES = 2;
// Before stuffing.
constexpr uint8_t MAX_PAYLOAD_BYTES = 48;
// On the line, all stuffed, with delimiter.
constexpr uint8_t MAX_FRAME_BYTES = 111;

// Timer1 and path clock, prescaler 1.
constexpr uint32_t TICKS_HZ = 16000000UL;
// Joints stepped by the compare outputs.
constexpr uint8_t JOINTS = 2;
// Exact on a 16 MHz Uno (UBRR 7, U2X).
constexpr uint32_t BAUD = 250000UL;
// Receive ring of the firmware.
constexpr uint8_t RX_RING_BYTES = 128;
// Most unacknowledged bytes, as encoded, the host may have in flight.
constexpr uint8_t HOST_WINDOW_BYTES = 112;
// Segments the firmware holds.
constexpr uint8_t QUEUE_SLOTS = 32;
// Least time between two steps of one joint; min_dir_setup_ticks more where it turns round.
constexpr uint16_t MIN_INTERVAL_TICKS = 320U;
// Largest interval inside a run of more than one step; longer gaps need a segment of their own.
constexpr uint16_t MAX_INTERVAL_TICKS = 60000U;
// Longest segment, about 67 s.
constexpr uint32_t MAX_SEGMENT_TICKS = 1073741823UL;
// Most steps of one joint in one segment.
constexpr uint16_t MAX_SEGMENT_STEPS = 32767U;
// Least lead of START, 1 ms.
constexpr uint16_t MIN_LEAD_TICKS = 16000U;
// Least high time of a step pulse, 2 us.
constexpr uint8_t MIN_STEP_HIGH_TICKS = 32;
// Least low time of a step pulse, 2 us.
constexpr uint8_t MIN_STEP_LOW_TICKS = 32;
// Least time from a DIR edge to the next rising STEP edge, 20 us.
constexpr uint16_t MIN_DIR_SETUP_TICKS = 320U;

// Step outputs, one a joint, as numbered on the board.
constexpr uint8_t STEP_PINS[JOINTS] = {9, 10};
// Direction outputs; high is the positive direction.
constexpr uint8_t DIR_PINS[JOINTS] = {4, 5};
// Active low.
constexpr uint8_t ENABLE_PIN = 8;

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
    // From the host: Appends segments, all or none. A broken limit latches bad_segment.
    SEGMENTS = 4,
    // From the host: Begins the queued motion: the first segment starts lead_ticks from now.
    START = 5,
    // From the host: Clears a latched fault and the refusal, drops the queue and releases the
    // drivers: fault, ready or idle to idle. Position counters stay.
    CLEAR = 6,
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
    // Executing segments; more may be queued.
    RUNNING = 2,
    // Pulses stopped, first fault latched, drivers keep holding; CLEAR leads to idle.
    FAULT = 3,
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

// Hello: payload of 5 bytes.
constexpr uint8_t HELLO_BYTES = 5;
namespace hello_at {
constexpr uint8_t PROTOCOL_VERSION = 0;  // u8
constexpr uint8_t HOST_NONCE = 1;        // u32
}  // namespace hello_at

// Query: payload of 0 bytes.
constexpr uint8_t QUERY_BYTES = 0;

// Enable: payload of 1 byte.
constexpr uint8_t ENABLE_BYTES = 1;
namespace enable_at {
constexpr uint8_t ON = 0;  // u8
}  // namespace enable_at

// Segments: payload of 3 to 48 bytes.
constexpr uint8_t SEGMENTS_MIN_BYTES = 3;

// Start: payload of 4 bytes.
constexpr uint8_t START_BYTES = 4;
namespace start_at {
constexpr uint8_t LEAD_TICKS = 0;  // u32, ticks
}  // namespace start_at

// Clear: payload of 0 bytes.
constexpr uint8_t CLEAR_BYTES = 0;

// Welcome: payload of 28 bytes.
constexpr uint8_t WELCOME_BYTES = 28;
namespace welcome_at {
constexpr uint8_t PROTOCOL_VERSION = 0;           // u8
constexpr uint8_t HOST_NONCE = 1;                 // u32
constexpr uint8_t BOOT_NONCE = 5;                 // u32
constexpr uint8_t SPEC_HASH = 9;                  // u32
constexpr uint8_t FIRMWARE_VERSION = 13;          // u8 x 3
constexpr uint8_t LEDGER_EXECUTED_SEGMENTS = 16;  // u32
constexpr uint8_t LEDGER_POSITION_USTEPS = 20;    // i32 x 2, usteps
}  // namespace welcome_at

// Status: payload of 24 bytes.
constexpr uint8_t STATUS_BYTES = 24;
namespace status_at {
constexpr uint8_t STATE = 0;                      // u8
constexpr uint8_t FAULT = 1;                      // u8
constexpr uint8_t REFUSAL = 2;                    // i8
constexpr uint8_t REFUSAL_SEQ = 3;                // u8
constexpr uint8_t FREE_SLOTS = 4;                 // u8, segments
constexpr uint8_t CRC_ERRORS = 5;                 // u8
constexpr uint8_t OVERRUNS = 6;                   // u8
constexpr uint8_t RING_FULL = 7;                  // u8
constexpr uint8_t MCU_TICKS = 8;                  // u32, ticks
constexpr uint8_t LEDGER_EXECUTED_SEGMENTS = 12;  // u32
constexpr uint8_t LEDGER_POSITION_USTEPS = 16;    // i32 x 2, usteps
}  // namespace status_at

static_assert(MAX_FRAME_BYTES <= HOST_WINDOW_BYTES, "the longest frame fits the host's window");
static_assert(HOST_WINDOW_BYTES < RX_RING_BYTES, "a full window fits the receive ring");

}  // namespace wire
}  // namespace planarm
