#include "board.h"

#include <deque>

#include "firmware.h"
#include "framing.h"
#include "hal_journal.h"
#include "hal_pins.h"
#include "hal_serial.h"
#include "hal_signals.h"
#include "hal_step_timer.h"
#include "messages.h"
#include "on_match.h"
#include "step_engine.h"
#include "supervisor.h"

namespace hal {
namespace board {

namespace {

namespace wire = planarm::wire;

constexpr uint32_t TICKS_A_BYTE = 10 * (wire::TICKS_HZ / wire::BAUD);
constexpr uint32_t READ_TICKS = 4;  // a reading of the timer

struct Channel {
    uint16_t edge;
    bool armed;
    bool high;
    bool matched;  // the flag that asks for the interrupt
    bool interrupt_on;
    uint8_t steps_left;
};

struct Board {
    uint64_t now;
    planarm_delays delays;
    uint32_t interrupts;
    unsigned locks;
    Channel channels[wire::JOINTS];
    bool dirs[wire::JOINTS];
    bool enable_high;
    std::deque<planarm_edge> edges;
    uint8_t ring[wire::RX_RING_BYTES];
    uint8_t ring_head;  // bytes received and taken, modulo 256
    uint8_t ring_tail;
    std::deque<uint8_t> sent;
    uint64_t sending_until;
    uint8_t ring_full;
    uint8_t holds;
    uint8_t emergency_run;
    Emergency emergency;
    bool emergency_told;
    uint8_t inputs;
    bool stop_watched;
    bool enable_active_high;
    bool was_enabled;  // the journal; like the next one it outlives a reset
};

Board uno;

void set_pin(bool& pin, bool level, uint8_t number) {
    if (pin == level) return;
    pin = level;
    uno.edges.push_back({uno.now, number, static_cast<uint8_t>(level)});
}

uint64_t next_match(const Channel& channel) {
    return uno.now + static_cast<uint16_t>(channel.edge - static_cast<uint16_t>(uno.now) - 1) + 1;
}

void match(uint8_t joint) {
    Channel& channel = uno.channels[joint];
    channel.matched = true;
    set_pin(channel.high, channel.armed && !channel.high, wire::STEP_PINS[joint]);
}

bool interrupt(uint8_t joint) {
    Channel& channel = uno.channels[joint];
    if (!channel.matched || !channel.interrupt_on) return false;
    channel.matched = false;
    uno.locks = 1;
    const planarm_delays& delays = uno.delays;
    ++uno.interrupts;
    const bool late = delays.late_every != 0 && uno.interrupts % delays.late_every == 0;
    elapse(late ? delays.late_entry : delays.entry);
    planarm::step_engine::on_match(joint);
    elapse(delays.leave);
    uno.locks = 0;
    return true;
}

void serve_interrupts() {
    bool served;
    do {
        served = false;
        for (uint8_t joint = 0; joint < wire::JOINTS && !served; ++joint) served = interrupt(joint);
    } while (served);
}

// Ticks up to and with the next match that asks for an interrupt, at most `most`.
uint64_t ticks_to_interrupt(uint64_t most) {
    for (const Channel& channel : uno.channels) {
        const uint64_t away = next_match(channel) - uno.now;
        if (channel.interrupt_on && away < most) most = away;
    }
    return most;
}

}  // namespace

void elapse(uint32_t ticks) {
    const uint64_t end = uno.now + ticks;
    for (;;) {
        uint64_t next = end;
        for (const Channel& channel : uno.channels) {
            if (next_match(channel) < next) next = next_match(channel);
        }
        if (uno.now == end) return;
        uno.now = next;
        for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
            if (uno.channels[joint].edge == static_cast<uint16_t>(next)) match(joint);
        }
    }
}

void lock() { ++uno.locks; }

void unlock() {
    if (--uno.locks == 0) serve_interrupts();
}

uint16_t counter() {
    elapse(READ_TICKS);
    return static_cast<uint16_t>(uno.now);
}

uint8_t laps() { return static_cast<uint8_t>(uno.now >> 16); }

uint16_t edge(uint8_t joint) { return uno.channels[joint].edge; }

void set_edge(uint8_t joint, uint16_t tick) { uno.channels[joint].edge = tick; }

void arm(uint8_t joint, bool armed) { uno.channels[joint].armed = armed; }

void fall(uint8_t joint) {
    Channel& channel = uno.channels[joint];
    set_pin(channel.high, channel.armed && !channel.high, wire::STEP_PINS[joint]);
}

uint8_t steps_left(uint8_t joint) { return uno.channels[joint].steps_left; }

void set_steps_left(uint8_t joint, uint8_t steps) { uno.channels[joint].steps_left = steps; }

bool is_high(uint8_t joint) { return uno.channels[joint].high; }

bool has_emergency() { return uno.emergency != Emergency::NONE; }

void forget_match(uint8_t joint) { uno.channels[joint].matched = false; }

void enable_interrupt(uint8_t joint, bool on) { uno.channels[joint].interrupt_on = on; }

bool interrupt_is_on(uint8_t joint) { return uno.channels[joint].interrupt_on; }

bool dir(uint8_t joint) { return uno.dirs[joint]; }

void write_dir(uint8_t joint, bool positive) { set_pin(uno.dirs[joint], positive, wire::DIR_PINS[joint]); }

}  // namespace board

using board::uno;

void drivers_enable(bool on) {
    board::set_pin(uno.enable_high, on == uno.enable_active_high, planarm::wire::ENABLE_PIN);
}

void set_enable_active_high(bool active_high) {
    uno.enable_active_high = active_high;
    drivers_enable(false);
}

uint8_t inputs() { return uno.inputs; }

void watch_stop_input(bool on) { uno.stop_watched = on; }

void journal_mark(bool enabled) { uno.was_enabled = enabled; }

void journal_serve() {}

uint8_t hold_count() { return uno.holds; }

Emergency emergency() { return uno.emergency; }

void emergency_told() { uno.emergency_told = true; }

void emergency_clear() {
    if (uno.emergency_told) uno.emergency = Emergency::NONE;
}

void watchdog_feed() {}

SerialBytes serial_peek() {
    const uint8_t at = uno.ring_tail % planarm::wire::RX_RING_BYTES;
    const uint8_t count = static_cast<uint8_t>(uno.ring_head - uno.ring_tail);
    const uint8_t together = static_cast<uint8_t>(planarm::wire::RX_RING_BYTES - at);
    return {uno.ring + at, count < together ? count : together};
}

void serial_drop(uint8_t count) { uno.ring_tail = static_cast<uint8_t>(uno.ring_tail + count); }

bool serial_can_send() { return uno.now >= uno.sending_until; }

uint8_t reply[MAX_REPLY_BYTES];

void serial_send(uint8_t size) {
    const size_t before = uno.sent.size();
    for (const uint8_t* at = reply + MAX_REPLY_BYTES - size; at != reply + MAX_REPLY_BYTES - 1; ++at) {
        const bool special = planarm::is_special(*at);
        if (special) uno.sent.push_back(wire::ESCAPE);
        uno.sent.push_back(special ? *at ^ wire::ESCAPE_XOR : *at);
    }
    uno.sent.push_back(wire::DELIMITER);
    uno.sending_until = uno.now + (uno.sent.size() - before) * board::TICKS_A_BYTE;
}

uint8_t serial_overruns() { return 0; }

uint8_t serial_ring_full() { return uno.ring_full; }

}  // namespace hal

namespace {

template <typename Item>
size_t take(std::deque<Item>& from, Item* to, size_t most) {
    size_t count = 0;
    for (; count < most && !from.empty(); ++count) {
        to[count] = from.front();
        from.pop_front();
    }
    return count;
}

}  // namespace

using hal::board::uno;

namespace {

void end_pulses(hal::Emergency cause) {
    hal::steps_off();
    hal::wait_step_high();
    hal::steps_fall();
    uno.emergency = cause;
    uno.emergency_told = false;
}

// What the receive interrupt does with a byte.
void receive_byte(uint8_t byte) {
    namespace wire = planarm::wire;
    if (byte == wire::EMERGENCY_CODE) {
        if (++uno.emergency_run >= wire::EMERGENCY_REPEATS) end_pulses(hal::Emergency::LINE);
        return;
    }
    uno.emergency_run = 0;
    if (byte == wire::HOLD_CODE) {
        ++uno.holds;
    } else if (static_cast<uint8_t>(uno.ring_head - uno.ring_tail) == wire::RX_RING_BYTES) {
        ++uno.ring_full;
    } else {
        uno.ring[uno.ring_head++ % wire::RX_RING_BYTES] = byte;
    }
}

}  // namespace

void planarm_power_on(uint32_t boot_count, uint64_t tick, planarm_delays delays) {
    const bool was_enabled = uno.was_enabled;
    uno = hal::board::Board();
    uno.now = tick;
    uno.delays = delays;
    uno.enable_high = true;
    planarm::firmware::set_up({boot_count, planarm::wire::Reset::POWER_ON, was_enabled},
                              static_cast<uint32_t>(tick));
}

void planarm_receive(const uint8_t* bytes, size_t count) {
    for (size_t i = 0; i < count; ++i) receive_byte(bytes[i]);
}

void planarm_set_inputs(uint8_t inputs) {
    const bool opens = (inputs & ~uno.inputs & hal::STOP_INPUT_OPEN) != 0;
    uno.inputs = inputs;
    if (opens && uno.stop_watched) end_pulses(hal::Emergency::INPUT);
}

void planarm_run(uint64_t ticks) {
    const uint64_t end = uno.now + ticks;
    while (uno.now < end) {
        planarm::firmware::pass();
        const uint64_t rest_until = uno.now + uno.delays.pass;
        while (uno.now < rest_until) {
            hal::board::elapse(static_cast<uint32_t>(hal::board::ticks_to_interrupt(rest_until - uno.now)));
            hal::board::serve_interrupts();
        }
    }
}

uint8_t planarm_signal(uint8_t event) {
    namespace supervisor = planarm::supervisor;
    const supervisor::Event told = static_cast<supervisor::Event>(event);
    const bool allowed = supervisor::allows(told);
    supervisor::apply(told);
    return allowed ? 1 : 0;
}

uint8_t planarm_state() { return static_cast<uint8_t>(planarm::supervisor::state()); }

void planarm_latch(uint8_t fault) { planarm::supervisor::fail(static_cast<planarm::wire::Fault>(fault)); }

uint64_t planarm_now() { return uno.now; }

size_t planarm_take_sent(uint8_t* bytes, size_t most) { return take(uno.sent, bytes, most); }

size_t planarm_take_edges(planarm_edge* edges, size_t most) { return take(uno.edges, edges, most); }
