#include "supervisor.h"

#include "hal_flash.h"
#include "home.h"
#include "motion.h"
#include "power.h"

namespace planarm {
namespace supervisor {

using wire::Fault;
using wire::State;

namespace {

struct Row {
    Event event;
    State from;
    State to;
    Outcome outcome;
};

// tests/firmware/test_firmware_supervisor.py holds the same table and tries every event in every state.
const Row ROWS[] HAL_FLASH = {
    {Event::ENABLE, State::IDLE, State::READY, Outcome::ENERGISE},
    {Event::ENABLE, State::READY, State::READY, Outcome::NONE},

    {Event::RELEASE, State::IDLE, State::IDLE, Outcome::NONE},
    {Event::RELEASE, State::READY, State::IDLE, Outcome::RELEASE},
    {Event::RELEASE, State::HELD, State::IDLE, Outcome::RELEASE},
    {Event::RELEASE, State::STARVED, State::IDLE, Outcome::RELEASE},

    {Event::SEGMENTS, State::READY, State::READY, Outcome::NONE},
    {Event::SEGMENTS, State::RUNNING, State::RUNNING, Outcome::NONE},
    {Event::SEGMENTS, State::HOLDING, State::HOLDING, Outcome::NONE},
    {Event::SEGMENTS, State::HELD, State::HELD, Outcome::NONE},
    {Event::SEGMENTS, State::STARVED, State::STARVED, Outcome::NONE},

    {Event::START, State::READY, State::RUNNING, Outcome::GO},

    {Event::CLEAR, State::IDLE, State::IDLE, Outcome::RELEASE},
    {Event::CLEAR, State::READY, State::IDLE, Outcome::RELEASE},
    {Event::CLEAR, State::HELD, State::IDLE, Outcome::RELEASE},
    {Event::CLEAR, State::STARVED, State::IDLE, Outcome::RELEASE},
    {Event::CLEAR, State::FAULT, State::IDLE, Outcome::RELEASE},

    {Event::HOLD, State::RUNNING, State::HOLDING, Outcome::REST},
    {Event::HOLD, State::STARVED, State::HOLDING, Outcome::REST},
    {Event::HOLD, State::HOMING, State::READY, Outcome::DROP},

    {Event::RESUME, State::HOLDING, State::RUNNING, Outcome::GO},
    {Event::RESUME, State::HELD, State::RUNNING, Outcome::GO},

    {Event::STOP, State::READY, State::READY, Outcome::DROP},
    {Event::STOP, State::RUNNING, State::STOPPING, Outcome::REST},
    {Event::STOP, State::HOLDING, State::STOPPING, Outcome::REST},
    {Event::STOP, State::STOPPING, State::STOPPING, Outcome::NONE},
    {Event::STOP, State::HELD, State::READY, Outcome::DROP},
    {Event::STOP, State::STARVED, State::READY, Outcome::DROP},
    {Event::STOP, State::HOMING, State::READY, Outcome::DROP},

    {Event::QUICK_STOP, State::READY, State::READY, Outcome::DROP},
    {Event::QUICK_STOP, State::RUNNING, State::STOPPING, Outcome::REST_QUICKLY},
    {Event::QUICK_STOP, State::HOLDING, State::STOPPING, Outcome::REST_QUICKLY},
    {Event::QUICK_STOP, State::STOPPING, State::STOPPING, Outcome::REST_QUICKLY},
    {Event::QUICK_STOP, State::HELD, State::READY, Outcome::DROP},
    {Event::QUICK_STOP, State::STARVED, State::READY, Outcome::DROP},
    {Event::QUICK_STOP, State::HOMING, State::READY, Outcome::DROP},

    {Event::CONFIG, State::IDLE, State::IDLE, Outcome::NONE},
    {Event::SOFT_LIMITS, State::IDLE, State::IDLE, Outcome::NONE},
    {Event::SOFT_LIMITS, State::READY, State::READY, Outcome::NONE},
    {Event::SET_POSITION, State::IDLE, State::IDLE, Outcome::NONE},
    {Event::SET_POSITION, State::READY, State::READY, Outcome::NONE},
    {Event::HOME, State::READY, State::HOMING, Outcome::DROP},

    {Event::AT_REST, State::HOLDING, State::HELD, Outcome::NONE},
    {Event::AT_REST, State::STOPPING, State::READY, Outcome::DROP},
    {Event::STARVED, State::RUNNING, State::STARVED, Outcome::NONE},
    {Event::FED, State::STARVED, State::RUNNING, Outcome::NONE},
    {Event::DONE, State::RUNNING, State::READY, Outcome::NONE},
    {Event::DONE, State::HOLDING, State::READY, Outcome::NONE},
    {Event::DONE, State::STOPPING, State::READY, Outcome::NONE},
    {Event::DONE, State::HOMING, State::READY, Outcome::DROP},
};

State current_state;
Fault latched_fault;
uint8_t latched_detail;

static_assert(sizeof(Row) == 4, "rows are read byte by byte");

bool find(Event event, Row& row) {
    for (const Row& candidate : ROWS) {
        const uint8_t* const bytes = reinterpret_cast<const uint8_t*>(&candidate);
        if (hal::flash_byte(bytes) != static_cast<uint8_t>(event)) continue;
        if (hal::flash_byte(bytes + 1) != static_cast<uint8_t>(current_state)) continue;
        row = {event, current_state, static_cast<State>(hal::flash_byte(bytes + 2)),
               static_cast<Outcome>(hal::flash_byte(bytes + 3))};
        return true;
    }
    return false;
}

void carry_out(Outcome outcome) {
    switch (outcome) {
        case Outcome::NONE:
            return;
        case Outcome::ENERGISE:
            return power::energise();
        case Outcome::RELEASE:
            motion::halt();
            latched_fault = Fault::NONE;
            latched_detail = 0;
            return power::release();
        case Outcome::DROP:
            home::cancel();
            return motion::halt();
        case Outcome::GO:
            return motion::set_wish(motion::Wish::GO);
        case Outcome::REST:
            return motion::set_wish(motion::Wish::REST);
        case Outcome::REST_QUICKLY:
            return motion::set_wish(motion::Wish::REST_QUICKLY);
    }
}

}  // namespace

void reset() {
    current_state = State::IDLE;
    latched_fault = Fault::NONE;
    latched_detail = 0;
}

State state() { return current_state; }

Fault fault() { return latched_fault; }

uint8_t fault_detail() { return latched_detail; }

bool allows(Event event) {
    Row row;
    return find(event, row);
}

void apply(Event event) {
    Row row;
    if (!find(event, row)) return;
    current_state = row.to;
    power::note_activity();
    carry_out(row.outcome);
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
