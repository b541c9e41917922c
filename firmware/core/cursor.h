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

    // True when a step is left in a slice.
    bool has_step_in(const path_clock::Slice& slice) const;

    // True when the joint is slower than its start-stop speed all over a slice that was not begun yet.
    bool is_calm(const path_clock::Slice& slice, uint32_t start_stop_ticks) const;

    // Makes a run of the next steps in a slice of the segment; has_step_in must hold. True when
    // it is close enough to the step before for the step interrupt to go on by itself.
    bool take(const path_clock::Slice& slice, Run& run);

    // The next slice is not as long as the one before.
    void forget_guess() { guess_ = 0; }

    // Nothing is left in the slice: another one follows.
    void finish(const path_clock::Slice& slice);

  private:
    // To the next step, and by so many.
    void step();
    void skip(uint8_t steps);
    // From the first step of a run, where it stands, to the last one in the slice; returns how many steps
    // they are.
    uint8_t go_to_last(const path_clock::Slice& slice, const Cursor& first);
    uint8_t guess(uint16_t path_ticks) const;
    bool fit(const uint32_t* stretches, Run& run) const;

    Fixed48 at_;  // path time of the next step, from the slice's start
    Steps left_;
    uint8_t guess_;             // steps of the segment's slice before; 0: none yet
    uint32_t last_path_ticks_;  // path time of the last step, from the slice's start, modulo 2^32
    uint32_t last_ticks_;       // its tick
};

}  // namespace planarm
