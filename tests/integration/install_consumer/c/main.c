#include <stdio.h>
#include <stridewire/client.h>
#include <string.h>

/* Creates a client, which starts its thread, and ends it. */
int main(void) {
  stridewire_client_options options;
  stridewire_client* client = NULL;
  stridewire_client_options_init(&options, sizeof options);
  if (stridewire_client_create(&options, &client) != STRIDEWIRE_OK) return 1;
  if (stridewire_client_connect(client, "127.0.0.1", 1) != STRIDEWIRE_OK) return 1;
  if (stridewire_client_wait_event(client, 10.0) != STRIDEWIRE_OK) return 1;
  stridewire_client_destroy(client);
  printf("stridewire %s from C\n", stridewire_version());
  return strcmp(stridewire_status_name(STRIDEWIRE_OK), "ok");
}
