// What servo.ino does, without Arduino's library for it, which Debian does not ship: one compare interrupt of timer 1
// gives the servos their pulses one after the other, and a rest up to 20 ms; the pins are set by digitalWrite.
const uint8_t PINS[] = {9, 10};
const uint8_t COUNT = sizeof PINS;
const uint16_t TICKS_PER_US = 2;  // clk/8
const uint16_t FRAME_TICKS = 20000U * TICKS_PER_US;
const uint16_t LEAST_US = 544, MOST_US = 2400, SOON_TICKS = 4;

volatile uint16_t widthTicks[COUNT];

ISR(TIMER1_COMPA_vect) {
  static uint8_t next = 0;  // whose pulse begins now; COUNT: the frame is full
  if (next > 0 && next <= COUNT) digitalWrite(PINS[next - 1], LOW);
  if (next < COUNT) {
    if (next == 0) TCNT1 = 0;
    digitalWrite(PINS[next], HIGH);
    OCR1A = TCNT1 + widthTicks[next];
    next++;
  } else {
    const uint16_t now = TCNT1;
    OCR1A = now + SOON_TICKS < FRAME_TICKS ? FRAME_TICKS : now + SOON_TICKS;
    next = 0;
  }
}

void writeMicroseconds(uint8_t servo, uint16_t us) {
  const uint8_t before = SREG;
  cli();
  widthTicks[servo] = us * TICKS_PER_US;
  SREG = before;
}

void write(uint8_t servo, uint8_t degrees) {
  writeMicroseconds(servo, map(min(degrees, (uint8_t)180), 0, 180, LEAST_US, MOST_US));
}

void setup() {
  Serial.begin(250000);
  write(0, 90);
  writeMicroseconds(1, 1000);
  for (uint8_t servo = 0; servo < COUNT; servo++) pinMode(PINS[servo], OUTPUT);
  TCCR1A = 0;
  TCCR1B = _BV(CS11);
  OCR1A = TCNT1 + SOON_TICKS;
  TIFR1 = _BV(OCF1A);
  TIMSK1 |= _BV(OCIE1A);
}

void loop() {
  if (Serial.available()) write(0, Serial.read());
}
