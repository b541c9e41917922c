// Why the chip started. The stock boot loader clears MCUSR before the firmware runs, so the cause is inferred
// from memory that a reset leaves alone.
#pragma once

#include "messages.h"

namespace hal {

// For start-up, once: also leaves the trace for the next start.
planarm::wire::Reset find_reset_cause();

}  // namespace hal
