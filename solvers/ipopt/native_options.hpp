#pragma once

#include <set>
#include <string>

#include <IpIpoptApplication.hpp>

#include "rhec/core/config/settings.hpp"

namespace rhec::ipopt {

/// Sets every key of a map as one of Ipopt's own options, with the type that Ipopt registered for it, and returns the
/// keys. Throws Error with the place and the key if Ipopt has no such option or refuses the value, or if the option
/// would print, read a file, or contradict an option of this plugin.
std::set<std::string> set_native_options(const Settings& native, Ipopt::IpoptApplication& application);

}  // namespace rhec::ipopt
