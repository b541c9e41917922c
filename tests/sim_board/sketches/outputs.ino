// A tone of half a second, two duty cycles, and a pause.
void setup() {
  pinMode(9, OUTPUT);
  analogWrite(9, 64);
  analogWrite(5, 200);
  tone(8, 1000, 500);
  digitalWrite(13, LOW);
  pinMode(13, OUTPUT);
  digitalWrite(13, HIGH);
  delay(100);
  digitalWrite(13, LOW);
  delayMicroseconds(50);
  digitalWrite(13, HIGH);
}

void loop() {}
