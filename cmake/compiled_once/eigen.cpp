#define RHEC_COMPILED_ONCE
#include "eigen.hpp"
