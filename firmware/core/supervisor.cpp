#include "supervisor.h"

#include "hal_pins.h"
#include "motion.h"

namespace planarm {
namespace supervisor {

using wire::Fault;
using wire::State;

namespace {

struct Transition {
    Command command;
    State from;
    State to;
};

// A command in a state that is not listed is refused.
constexpr Transition TRANSITIONS[] = {
    {Command::ENABLE, State::IDLE, State::READY},    {Command::ENABLE, State::READY, State::READY},
    {Command::RELEASE, State::READY, State::IDLE},   {Command::RELEASE, State::IDLE, State::IDLE},
    {Command::SEGMENTS, State::READY, State::READY}, {Command::SEGMENTS, State::RUNNING, State::RUNNING},
    {Command::START, State::READY, State::RUNNING},  {Command::CLEAR, State::IDLE, State::IDLE},
    {Command::CLEAR, State::READY, State::IDLE},     {Command::CLEAR, State::FAULT, State::IDLE},
};

State current_state;
Fault latched_fault;

const Transition* find(Command command) {
    for (const Transition& transition : TRANSITIONS) {
        if (transition.command == command && transition.from == current_state) return &transition;
    }
    return nullptr;
}

}  // namespace

void reset() {
    current_state = State::IDLE;
    latched_fault = Fault::NONE;
}

State state() { return current_state; }

Fault fault() { return latched_fault; }

bool allows(Command command) { return find(command) != nullptr; }

void apply(Command command, uint32_t now_ticks) {
    current_state = find(command)->to;
    if (current_state == State::IDLE) {
        motion::halt(now_ticks);
        latched_fault = Fault::NONE;
    }
    hal::drivers_enable(current_state != State::IDLE);
}

void motion_done() { current_state = State::READY; }

void fail(Fault fault, uint32_t now_ticks) {
    motion::halt(now_ticks);
    latched_fault = fault;
    current_state = State::FAULT;
}

}  // namespace supervisor
}  // namespace planarm
