// A task that works beside loop(), on the other core and with the lowest priority.
#pragma once

namespace foldcar {

// Calls step(context) for ever: again after a millisecond while it returns true, else after a while. Returns false if there
// is no memory for the task.
bool start_background_task(bool (*step)(void*), void* context);

}  // namespace foldcar
