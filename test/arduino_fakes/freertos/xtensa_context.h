// Fake of ESP-IDF 4.4: the registers of a task that was interrupted (exit is not 0), and of one that went to sleep.
#pragma once

struct XtExcFrame {
  long exit, pc, ps, a0, a1;
  long exccause, excvaddr;
};

struct XtSolFrame {
  long exit, pc, ps, next, a0, a1;
};
