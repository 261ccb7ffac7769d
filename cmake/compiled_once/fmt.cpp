#define RHEC_COMPILED_ONCE
#include "fmt.hpp"
