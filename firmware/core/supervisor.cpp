#include "supervisor.h"

#include "hal_base.h"
#include "hal_flash.h"
#include "hal_signals.h"
#include "home.h"
#include "motion.h"
#include "power.h"

namespace planarm {
namespace supervisor {

using wire::Fault;
using wire::State;

namespace {

// A row of the table in two bytes: state and next state, event and outcome. Each is found by a mask of its
// byte.
constexpr uint16_t row(Event event, State from, State to, Outcome outcome) {
    return static_cast<uint16_t>(static_cast<unsigned>(from) << 12 | static_cast<unsigned>(to) << 8 |
                                 static_cast<unsigned>(event) << 3 | static_cast<unsigned>(outcome));
}
constexpr uint16_t ASKED = 0xF0F8;  // state and event
static_assert(static_cast<uint8_t>(Event::CLEAR_KEPT) < 32 && static_cast<uint8_t>(State::HOMING) < 16 &&
                  static_cast<uint8_t>(Outcome::FORGET) < 8 &&
                  row(Event::ENABLE, State::IDLE, State::READY, Outcome::ENERGISE) != 0,
              "the widths in a row; 0 is none");

// tests/firmware/test_firmware_supervisor.py holds the same table and tries every event in every state.
const uint16_t ROWS[] HAL_FLASH = {
    row(Event::ENABLE, State::IDLE, State::READY, Outcome::ENERGISE),
    row(Event::ENABLE, State::READY, State::READY, Outcome::NONE),

    row(Event::RELEASE, State::IDLE, State::IDLE, Outcome::NONE),
    row(Event::RELEASE, State::READY, State::IDLE, Outcome::RELEASE),
    row(Event::RELEASE, State::HELD, State::IDLE, Outcome::RELEASE),
    row(Event::RELEASE, State::STARVED, State::IDLE, Outcome::RELEASE),

    row(Event::SEGMENTS, State::READY, State::READY, Outcome::NONE),
    row(Event::SEGMENTS, State::RUNNING, State::RUNNING, Outcome::NONE),
    row(Event::SEGMENTS, State::HOLDING, State::HOLDING, Outcome::NONE),
    row(Event::SEGMENTS, State::HELD, State::HELD, Outcome::NONE),
    row(Event::SEGMENTS, State::STARVED, State::STARVED, Outcome::NONE),

    row(Event::START, State::READY, State::RUNNING, Outcome::GO),

    row(Event::CLEAR, State::FAULT, State::IDLE, Outcome::RELEASE),
    row(Event::CLEAR_KEPT, State::IDLE, State::IDLE, Outcome::RELEASE),
    row(Event::CLEAR_KEPT, State::READY, State::READY, Outcome::FORGET),
    row(Event::CLEAR_KEPT, State::HELD, State::READY, Outcome::FORGET),
    row(Event::CLEAR_KEPT, State::STARVED, State::READY, Outcome::FORGET),
    row(Event::CLEAR_KEPT, State::FAULT, State::READY, Outcome::FORGET),

    row(Event::HOLD, State::RUNNING, State::HOLDING, Outcome::REST),
    row(Event::HOLD, State::STARVED, State::HOLDING, Outcome::REST),
    row(Event::HOLD, State::HOMING, State::READY, Outcome::DROP),

    row(Event::RESUME, State::HOLDING, State::RUNNING, Outcome::GO),
    row(Event::RESUME, State::HELD, State::RUNNING, Outcome::GO),

    row(Event::STOP, State::READY, State::READY, Outcome::DROP),
    row(Event::STOP, State::RUNNING, State::STOPPING, Outcome::REST),
    row(Event::STOP, State::HOLDING, State::STOPPING, Outcome::REST),
    row(Event::STOP, State::STOPPING, State::STOPPING, Outcome::NONE),
    row(Event::STOP, State::HELD, State::READY, Outcome::DROP),
    row(Event::STOP, State::STARVED, State::READY, Outcome::DROP),
    row(Event::STOP, State::HOMING, State::READY, Outcome::DROP),

    row(Event::QUICK_STOP, State::READY, State::READY, Outcome::DROP),
    row(Event::QUICK_STOP, State::RUNNING, State::STOPPING, Outcome::REST_QUICKLY),
    row(Event::QUICK_STOP, State::HOLDING, State::STOPPING, Outcome::REST_QUICKLY),
    row(Event::QUICK_STOP, State::STOPPING, State::STOPPING, Outcome::REST_QUICKLY),
    row(Event::QUICK_STOP, State::HELD, State::READY, Outcome::DROP),
    row(Event::QUICK_STOP, State::STARVED, State::READY, Outcome::DROP),
    row(Event::QUICK_STOP, State::HOMING, State::READY, Outcome::DROP),

    row(Event::CONFIG, State::IDLE, State::IDLE, Outcome::NONE),
    row(Event::SOFT_LIMITS, State::IDLE, State::IDLE, Outcome::NONE),
    row(Event::SOFT_LIMITS, State::READY, State::READY, Outcome::NONE),
    row(Event::SET_POSITION, State::IDLE, State::IDLE, Outcome::NONE),
    row(Event::SET_POSITION, State::READY, State::READY, Outcome::NONE),
    row(Event::HOME, State::READY, State::HOMING, Outcome::DROP),

    row(Event::AT_REST, State::HOLDING, State::HELD, Outcome::NONE),
    row(Event::AT_REST, State::STOPPING, State::READY, Outcome::DROP),
    row(Event::STARVED, State::RUNNING, State::STARVED, Outcome::NONE),
    row(Event::FED, State::STARVED, State::RUNNING, Outcome::NONE),
    row(Event::DONE, State::RUNNING, State::READY, Outcome::NONE),
    row(Event::DONE, State::HOLDING, State::READY, Outcome::NONE),
    row(Event::DONE, State::STOPPING, State::READY, Outcome::NONE),
    row(Event::DONE, State::HOMING, State::READY, Outcome::DROP),
};

State current_state;
Fault latched_fault;
uint8_t latched_detail;

// The event's row in this state; 0 when there is none: the first row is not 0.
uint16_t find(Event event) {
    const uint16_t wanted = row(event, current_state, State::IDLE, Outcome::NONE);
    for (const uint16_t& entry : ROWS) {
        const uint16_t found = hal::flash_word(&entry);
        if (((found ^ wanted) & ASKED) == 0) return found;
    }
    return 0;
}

constexpr motion::Wish wish_of(Outcome outcome) {
    return static_cast<motion::Wish>(static_cast<uint8_t>(outcome) - static_cast<uint8_t>(Outcome::GO));
}
static_assert(wish_of(Outcome::REST) == motion::Wish::REST &&
                  wish_of(Outcome::REST_QUICKLY) == motion::Wish::REST_QUICKLY,
              "the same order");

void carry_out(Outcome outcome) {
    switch (outcome) {
        case Outcome::NONE:
            return;
        case Outcome::ENERGISE:
            return power::energise();
        case Outcome::RELEASE:
            power::release();
            // fall through - the drivers are off, the fault is forgotten
        case Outcome::FORGET:
            latched_fault = Fault::NONE;
            latched_detail = 0;
            return motion::halt();
        case Outcome::DROP:
            home::cancel();
            return motion::halt();
        case Outcome::GO:
        case Outcome::REST:
        case Outcome::REST_QUICKLY:
            return motion::set_wish(wish_of(outcome));
    }
}

}  // namespace

void reset() {
    static_assert(static_cast<uint8_t>(State::IDLE) == 0 && static_cast<uint8_t>(Fault::NONE) == 0,
                  "memory is clear");
    hal::clear_at_start(current_state);
    hal::clear_at_start(latched_fault);
    hal::clear_at_start(latched_detail);
}

State state() { return current_state; }

Fault fault() { return latched_fault; }

uint8_t fault_detail() { return latched_detail; }

Event clear_event() {
    switch (latched_fault) {
        case Fault::EMERGENCY_STOP:
        case Fault::STOP_INPUT:
        case Fault::HOMING_FAILED:
            return Event::CLEAR;
        default:
            return Event::CLEAR_KEPT;
    }
}

Fault tell_fault() {
    if (clear_event() == Event::CLEAR) hal::emergency_told();
    return latched_fault;
}

bool allows(Event event) { return find(event) != 0; }

void apply(Event event) {
    const uint16_t found = find(event);
    if (found == 0) return;
    current_state = static_cast<State>((found >> 8) & 0x0F);
    power::note_activity();
    carry_out(static_cast<Outcome>(found & 0x07));
}

void fail(Fault fault, uint8_t detail) {
    home::cancel();
    motion::halt();
    latched_fault = fault;
    latched_detail = detail;
    current_state = State::FAULT;
}

}  // namespace supervisor
}  // namespace planarm
