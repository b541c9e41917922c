// Works off one joint's steps of a segment, piece by piece, into the runs of the step engine.
#pragma once

#include <stdint.h>

#include "fixed.h"
#include "path_clock.h"
#include "segment.h"
#include "step_engine.h"

namespace planarm {

class Cursor {
  public:
    // No steps, and none made yet. For start-up and after every stop.
    void reset();

    // Takes the joint's steps of the next segment.
    void begin(const Move& move);

    // True when a step is left before a path time of the segment.
    bool has_step_before(uint32_t path_ticks) const { return left_ != 0 && at_.high < path_ticks; }

    // True when the joint is slower than its start-stop speed all over a slice that was not begun yet.
    bool is_calm(const path_clock::Slice& slice, uint32_t start_stop_ticks) const;

    // Makes a run of the next steps in a slice of the segment; has_step_before its end must hold.
    step_engine::Piece take(const path_clock::Slice& slice);

    // The segment lasts so long.
    void finish(uint32_t segment_ticks);

    // The clock stood still for `ticks`.
    void shift(uint32_t ticks) { last_ticks_ += ticks; }

  private:
    // How many steps the next run makes before a border so far away, and the time from the first to the last
    // of them. The last slice of a segment takes them all.
    uint8_t steps_before(uint16_t path_ticks, bool ends_segment, Fixed48& to_last) const;
    // Ticks from the next step's to that of a step so long after it.
    uint32_t ticks_to(Fixed48 time) const {
        return time.high + (static_cast<uint16_t>(at_.low + time.low) < time.low ? 1 : 0);
    }
    void advance(uint8_t steps, Fixed48 to_last);

    Fixed48 at_;  // path time of the next step, from the segment's start
    uint32_t interval_q16_;
    int32_t add_q16_;
    uint16_t left_;
    bool positive_;
    bool has_moved_;
    uint32_t last_path_ticks_;  // path time of the last step, from the segment's start, modulo 2^32
    uint32_t last_ticks_;       // its tick
};

}  // namespace planarm
