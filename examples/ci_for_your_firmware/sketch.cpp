// Somebody's own sketch, in plain C++ so that avr-gcc alone builds it: one motor, one turn there, one turn
// back, with ramps. STEP is D2 (PD2), DIR is D5 (PD5), ENABLE is D8 (PB0, active low).
#include <avr/io.h>
#include <util/delay.h>

static const uint16_t kStepsPerTurn = 3200;  // 200 full steps, 16 micro-steps
static const uint16_t kRampSteps = 600;
static const uint16_t kSlowUs = 900;
static const uint16_t kFastUs = 250;

static void wait_us(uint16_t us) {
    while (us--) _delay_us(1);
}

static void step(uint16_t pause_us) {
    PORTD |= 1 << PD2;
    _delay_us(3);
    PORTD &= ~(1 << PD2);
    wait_us(pause_us);
}

static void turn_once(bool forward) {
    if (forward) {
        PORTD |= 1 << PD5;
    } else {
        PORTD &= ~(1 << PD5);
    }
#ifdef TOO_SHORT
    PORTD |= 1 << PD2;  // the bug that the tests find: a pulse that no driver need take for one
    PORTD &= ~(1 << PD2);
#endif
    _delay_us(10);
    for (uint16_t n = 0; n < kStepsPerTurn; ++n) {
        const uint16_t left = kStepsPerTurn - 1 - n;
        const uint16_t near = n < left ? n : left;
        const uint16_t ramp = near < kRampSteps ? near : kRampSteps;
        step(kSlowUs - static_cast<uint32_t>(kSlowUs - kFastUs) * ramp / kRampSteps);
    }
}

int main() {
    DDRD |= 1 << PD2 | 1 << PD5;
    DDRB |= 1 << PB0;
    _delay_ms(2);
    turn_once(true);
    _delay_ms(500);
    turn_once(false);
    for (;;) {
    }
}
