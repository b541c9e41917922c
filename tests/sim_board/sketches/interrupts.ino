// Answers rising edges of D2 by D13, from an interrupt.
volatile unsigned int count;

void rises() {
  count++;
  digitalWrite(13, !digitalRead(13));
}

void setup() {
  pinMode(13, OUTPUT);
  Serial.begin(250000);
  attachInterrupt(digitalPinToInterrupt(2), rises, RISING);
}

void loop() {
  if (Serial.available()) {
    Serial.read();
    Serial.println(count);
  }
}
