// Tells its time, at a rising edge of D8, once for each byte that comes.
void setup() {
  pinMode(8, OUTPUT);
  Serial.begin(250000);
}

void loop() {
  if (!Serial.available()) return;
  Serial.read();
  digitalWrite(8, HIGH);
  unsigned long us = micros();
  unsigned long ms = millis();
  digitalWrite(8, LOW);
  Serial.print(us);
  Serial.print(' ');
  Serial.println(ms);
}
