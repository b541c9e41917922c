#include "inputs.h"

#include "clock.h"
#include "hal_base.h"
#include "hal_pins.h"
#include "settings.h"

namespace planarm {
namespace inputs {

namespace {

struct Inputs {
    uint8_t steady;  // debounced; bit j: joint j, hit
    uint8_t left;    // hit before the motion began, and not yet open since
    uint8_t once;    // those that have not been as `steady` since the last turn
    uint8_t twice;   // nor since the one before
    uint8_t turned;  // when, in 256 ticks, modulo 256
};

Inputs state;

// Two turns are the time that a change must last, in 256 ticks; it counts at the third.
constexpr uint8_t TURN = wire::DEBOUNCE_TICKS / 512 + 1;
static_assert((2 * TURN - 1) * 256UL >= wire::DEBOUNCE_TICKS, "one less for what the division cuts off");

uint8_t now_256() { return static_cast<uint8_t>(clock::pass_ticks() >> 8); }

constexpr uint8_t JOINTS_MASK = (1 << wire::JOINTS) - 1;

uint8_t read() {
    uint8_t bits = hal::inputs();
    if (settings::has_option(settings::LIMITS_OPEN_WHEN_HIT)) bits = static_cast<uint8_t>(~bits);
    return bits & JOINTS_MASK;
}

bool is_set(uint8_t bits, uint8_t joint) { return ((bits >> joint) & 1) != 0; }

}  // namespace

void reset() {
    hal::clear_at_start(state);
    Inputs& at = hal::by_base(state);
    at.steady = at.left = read();
}

void serve() {
    Inputs& at = hal::by_base(state);
    const uint8_t differs = read() ^ at.steady;
    at.once &= differs;
    at.twice &= differs;
    const uint8_t now = now_256();
    if (static_cast<uint8_t>(now - at.turned) < TURN) return;
    at.turned = now;
    at.steady ^= at.twice;
    at.left &= at.steady;
    const uint8_t waiting = differs ^ at.twice;
    at.twice = at.once & waiting;
    at.once = waiting;
}

void excuse_hit() { state.left = state.steady; }

bool is_hit(uint8_t joint) { return is_set(state.steady, joint); }

uint8_t hit_joint() {
    if (!settings::has_option(settings::LIMIT_SWITCHES)) return wire::JOINTS;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        if (is_set(static_cast<uint8_t>(state.steady & ~state.left), joint)) return joint;
    }
    return wire::JOINTS;
}

uint8_t report() { return static_cast<uint8_t>(state.steady | (hal::inputs() & hal::STOP_INPUT_OPEN)); }

}  // namespace inputs
}  // namespace planarm
