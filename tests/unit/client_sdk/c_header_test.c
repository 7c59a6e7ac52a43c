/** Compiled as C99, because the ABI must not require a newer standard. */
#include <string.h>

#include "stridewire/client.h"

/** Returns 0, or the number of the line that failed. */
int StridewireUsedFromC(void) {
  stridewire_client_options options;
  stridewire_client* client = NULL;
  stridewire_world world = 0;
  stridewire_event events[4];
  size_t count = 9;

  stridewire_client_options_init(&options, sizeof options);
  if (options.struct_bytes != sizeof options) return __LINE__;
  options.client_name = "a C program";
  if (stridewire_client_create(&options, &client) != STRIDEWIRE_OK) return __LINE__;
  if (stridewire_client_get_state(client) != STRIDEWIRE_STATE_IDLE) return __LINE__;
  if (stridewire_client_join_world(client, "plaza", STRIDEWIRE_CONTROLLER, &world, NULL) !=
      STRIDEWIRE_CLOSED) {
    return __LINE__;
  }
  if (stridewire_client_poll_events(client, events, 4, &count) != STRIDEWIRE_OK) return __LINE__;
  if (count != 0) return __LINE__;
  if (strcmp(stridewire_status_name(STRIDEWIRE_CLOSED), "closed") != 0) return __LINE__;
  stridewire_client_destroy(client);
  stridewire_client_destroy(NULL);
  return 0;
}
