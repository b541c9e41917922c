// The step interrupt in plain C++. The native board runs it; hal/uno/step_interrupts.cpp does the same,
// statement by statement, in assembler.
#pragma once

#include "hal_step_timer.h"
#include "step_engine.h"

namespace planarm {
namespace step_engine {

// Counts the step that has just risen and places the next one.
inline void on_match(uint8_t joint) {
    Run* const run = step_joints[joint].active;
    const uint8_t left = static_cast<uint8_t>(hal::steps_left(joint) - 1);
    hal::set_steps_left(joint, left);
    uint16_t edge;
    uint16_t margin = STEP_MARGIN_TICKS;
    if (left != 0) {
        const uint32_t ahead = run->interval_q16 + run->fraction;
        run->fraction = static_cast<uint16_t>(ahead);
        edge = static_cast<uint16_t>(hal::step_edge(joint) + (ahead >> 16));
        run->interval_q16 += run->add_q16;
        hal::step_fall(joint);
    } else {
        Run* const next = run->next;
        step_joints[joint].active = next;
        const Chain chained = next->chained;
        hal::set_steps_left(joint, next->steps);
        edge = static_cast<uint16_t>(next->first_ticks);
        hal::step_fall(joint);
        if (chained == Chain::NONE) {
            hal::step_end(joint);
            return;
        }
        if (chained == Chain::REVERSED) {
            hal::dir_set(joint, next->dir_high);
            margin = DIR_MARGIN_TICKS;
        }
    }
    const uint16_t nearest = static_cast<uint16_t>(hal::counter() + margin);
    if (static_cast<int16_t>(edge - nearest) >= 0) {
        hal::step_set_edge(joint, edge);
        return;
    }
    step_missed = hal::step_interrupts_on();
    hal::steps_off();
}

}  // namespace step_engine
}  // namespace planarm
