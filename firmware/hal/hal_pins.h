// The drivers' common pin. STEP and DIR are in hal_step_timer.h, which each board has of its own.
#pragma once

namespace hal {

// Energises or releases the drivers.
void drivers_enable(bool on);

}  // namespace hal
