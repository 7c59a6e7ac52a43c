#include "app/program.h"

int main(int argc, char** argv) { return stridewire::server::RunProgram(argc, argv); }
