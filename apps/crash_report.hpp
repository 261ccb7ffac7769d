#pragma once

#include "rhec/plugins/host/host.hpp"

namespace rhec::apps {

/// From now on, what ends this process before its time (a crash, or a call of exit) is told on standard error with the
/// plugin in whose library, or in a call of which, it happened. A crash ends the process by its signal as without this.
void install_crash_report();

/// The plugins that may be named from now on: those that a host accepts, the first 256.
void name_in_crash_report(const Host& host);

/// The command is done: the process may exit.
void end_crash_report();

/// The host of a command: each plugin is examined in a process of its own, and named where it crashes later.
Host examined_host(const std::vector<std::filesystem::path>& plugin_path, bool anew = false);

}  // namespace rhec::apps
