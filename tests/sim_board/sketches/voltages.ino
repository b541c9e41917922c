// Reads two inputs for each byte that comes.
void setup() { Serial.begin(250000); }

void loop() {
  if (!Serial.available()) return;
  Serial.read();
  Serial.print(analogRead(A0));
  Serial.print(' ');
  Serial.println(analogRead(A5));
}
