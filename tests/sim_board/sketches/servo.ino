// Two servos, and one that moves when a byte tells where.
#include <Servo.h>

Servo left, right;

void setup() {
  Serial.begin(250000);
  left.attach(9);
  right.attach(10);
  left.write(90);
  right.writeMicroseconds(1000);
}

void loop() {
  if (Serial.available()) left.write(Serial.read());
}
