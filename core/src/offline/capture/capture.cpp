#include "stridewire/offline/capture.h"
