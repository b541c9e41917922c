// The board uno_four: Own wiring, four joints: joints 1 and 2 as with two, joints 3 and 4 stepped
// by interrupts.
//
// Generated from protocol/messages.toml by `python -m planarm_wire.generate`; do not edit.
#pragma once

#include <stdint.h>

namespace planarm {
namespace wire {

// Joints that segments and ledger tell of.
constexpr uint8_t JOINTS = 4;
// Bytes of queued segments it holds; a SEGMENTS frame takes its payload and queue_frame_bytes.
constexpr uint16_t QUEUE_BYTES = 582U;
// Least time between two steps of one joint.
constexpr uint16_t MIN_INTERVAL_TICKS = 1000U;
// Least high time of a step pulse.
constexpr uint8_t MIN_STEP_HIGH_TICKS = 56;
// Least low time of a step pulse.
constexpr uint8_t MIN_STEP_LOW_TICKS = 40;
// The pin map own.
constexpr uint8_t PIN_MAP_CODE = 0;
// Step outputs, one a joint, as numbered on the board.
constexpr uint8_t STEP_PINS[JOINTS] = {9, 10, 6, 7};
// Direction outputs; high is the positive direction.
constexpr uint8_t DIR_PINS[JOINTS] = {4, 5, 2, 3};
// Limit switches, to ground.
constexpr uint8_t LIMIT_PINS[JOINTS] = {15, 16, 17, 18};
// Active low.
constexpr uint8_t ENABLE_PIN = 8;
// The stop input, to ground.
constexpr uint8_t STOP_PIN = 14;

}  // namespace wire
}  // namespace planarm
