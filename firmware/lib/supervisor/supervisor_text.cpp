// The names of states, faults and refusals: short, lower case, for status lines and messages.
#include "supervisor.h"

namespace foldcar {

const char* text(State state) {
  switch (state) {
    case State::kDisarmed: return "disarmed";
    case State::kArmed: return "armed";
    case State::kRunning: return "running";
    case State::kFinished: return "finished";
    case State::kFault: return "fault";
    case State::kManual: return "manual";
    case State::kTesting: return "testing";
    case State::kCounting: return "counting";
  }
  return "?";
}

const char* text(Fault fault) {
  switch (fault) {
    case Fault::kNone: return "none";
    case Fault::kBus: return "servo driver does not answer";
    case Fault::kBatteryUnreadable: return "battery voltage unreadable";
    case Fault::kBatteryLow: return "battery low";
    case Fault::kCommandStale: return "no command from the host";
    case Fault::kStoredParameter: return "stored parameter out of range";
    case Fault::kDesign: return "car.json is refused";
    case Fault::kWatchdog: return "reset by the task watchdog";
    case Fault::kBrownOut: return "reset by a dip of the supply";
    case Fault::kTilt: return "tilted too far";
    case Fault::kImu: return "IMU does not answer";
    case Fault::kNoDesign: return "no car.json";
    case Fault::kFlash: return "flash memory cannot be read";
    case Fault::kInterruptWatchdog: return "reset by the interrupt watchdog";
    case Fault::kCrash: return "reset by a crash";
    case Fault::kServoBatteryLow: return "servos' battery low or off";
  }
  return "?";
}

const char* text(Refusal refusal) {
  switch (refusal) {
    case Refusal::kNone: return "ok";
    case Refusal::kNotArmed: return "not armed";
    case Refusal::kRunning: return "a trial is running";
    case Refusal::kNotRunning: return "no trial is running";
    case Refusal::kFaultLatched: return "a fault is not acknowledged";
    case Refusal::kNoFault: return "there is no fault";
    case Refusal::kBatteryUnreadable: return "battery voltage unreadable";
    case Refusal::kBatteryLow: return "battery low";
    case Refusal::kNoWheels: return "no wheel on the left or on the right";
    case Refusal::kNotANumber: return "a value is not a number";
    case Refusal::kSpeedLimit: return "speed beyond its limit";
    case Refusal::kYawRateLimit: return "yaw rate beyond its limit";
    case Refusal::kTimeLimit: return "time limit not above 0 or above TRIAL_MAX_S";
    case Refusal::kDesign: return "car.json is refused";
    case Refusal::kTest: return "no such output, value or time-out";
    case Refusal::kMessage: return "no such message, or an interval below 20 ms";
    case Refusal::kNotDisarmed: return "not disarmed";
    case Refusal::kUnknownHost: return "no other packet of this host in the 2 s before";
    case Refusal::kHeld: return "another host has armed the car";
    case Refusal::kLate: return "it waited while the car stood still";
    case Refusal::kNoDesign: return "no car.json, and its absence is not confirmed";
    case Refusal::kUnknownCommand: return "not a command of this car";
    case Refusal::kNoLog: return "no log can be stored: flash memory cannot be read";
    case Refusal::kStoring: return "a log is being stored or erased";
    case Refusal::kNoButton: return "BUTTON_WIRED is 0";
    case Refusal::kDelay: return "delay below 0 or above 60 s";
    case Refusal::kUnknownParameter: return "not a parameter";
    case Refusal::kBelowMinimum: return "below the parameter's minimum";
    case Refusal::kAboveMaximum: return "above the parameter's maximum";
    case Refusal::kNotAnInteger: return "not a whole number";
    case Refusal::kNotASign: return "neither -1 nor 1";
    case Refusal::kFixed: return "set by car.json";
    case Refusal::kNotSaved: return "set, but not saved";
    case Refusal::kServoBatteryLow: return "servos' battery low or off";
  }
  return "?";
}

}  // namespace foldcar
