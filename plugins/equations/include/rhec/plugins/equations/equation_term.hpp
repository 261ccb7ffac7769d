#pragma once

#include <memory>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/core/term/term.hpp"

namespace rhec {

/// A term of a controller's problem whose equations stand in a configuration (docs/terms.md): `settings` has them as a
/// map at the key "equations", beside the term's options, "hard" and "soft". It needs no compiler. Throws Error with
/// the place of a mistake.
RHEC_EXPORT std::shared_ptr<Term> load_inline_term(const Settings& settings);

}  // namespace rhec
