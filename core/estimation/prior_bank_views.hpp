#pragma once

#include <vector>

#include "rhec/core/estimation/prior_bank.hpp"
#include "rhec/core/kernels/bank_kernels.hpp"

namespace rhec {

/// What the kernels are given.
struct PriorBank::Views {
  std::vector<BankProcess> processes;
  std::vector<BankOutput> outputs;
};

}  // namespace rhec
