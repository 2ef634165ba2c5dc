// Copyright 2026 fam_bundle_ros contributors
// SPDX-License-Identifier: Apache-2.0
// What a sketch needs of Arduino, on a computer: the serial port is stdin and stdout, and behind
// the pins are two muscles. Pressures are in counts, the supply is at 400 of them.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <poll.h>
#include <time.h>
#include <unistd.h>

enum { LOW, HIGH, INPUT, OUTPUT, INPUT_PULLUP };
enum { A0 = 14, A1, A2, A3, A4 };

static int pins[20];
static double pressure[2];

static uint32_t micros() {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1000000ull + now.tv_nsec / 1000;
}
static void pinMode(int, int) {}
static void digitalWrite(int pin, int value) { pins[pin] = value; }
static void analogWrite(int pin, int value) { pins[pin] = value; }
// The button is released.
static int digitalRead(int) { return HIGH; }
static int analogRead(int pin) {
  if (pin == A3 || pin == A4) return lround(pressure[pin - A3]);
  return pin == A2 ? (pins[4] ? 400 : 0) : 7;
}

struct Port {
  void begin(long) {}
  bool available() {
    pollfd waiting = {0, POLLIN, 0};
    return poll(&waiting, 1, 0) > 0 && waiting.revents & POLLIN;
  }
  char read() {
    char c;
    if (::read(0, &c, 1) != 1) exit(0);
    return c;
  }
  void print(const char *text) {
    if (write(1, text, strlen(text)) < 0) exit(0);
  }
} Serial;

void setup();
void loop();

int main() {
  const int fill[2] = {3, 5}, exhaust[2] = {6, 9};
  setup();
  uint32_t last = micros();
  while (true) {
    loop();
    double dt = (uint32_t)(micros() - last) * 1e-6;
    last = micros();
    for (int i = 0; i < 2; i++) {
      double in = pins[fill[i]] / 255.0, out = 1.0 - pins[exhaust[i]] / 255.0;
      pressure[i] += fmin(dt / 0.05, 1.0) * (in * (400.0 * pins[4] - pressure[i])
                                             - out * pressure[i]);
    }
    usleep(500);
  }
}
