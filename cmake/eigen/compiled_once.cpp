#define RHEC_COMPILED_ONCE
#include "compiled_once.hpp"
