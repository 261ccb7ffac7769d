// The only translation unit that uses OpenSSL.
#include "rhec/sim/store/run_identity.hpp"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::sim {
namespace {

void append_canonical(const Settings& settings, std::string& text) {
  switch (settings.kind()) {
    case Settings::Kind::null:
      text += "null";
      return;
    case Settings::Kind::scalar:
      if (const auto number = settings.number()) {
        if (std::isfinite(*number)) {
          fmt::format_to(std::back_inserter(text), "{}", *number);
        } else {
          text += *number > 0.0 ? "\".inf\"" : "\"-.inf\"";
        }
      } else if (settings.flag()) {
        text += settings.text();
      } else {
        append_quoted(settings.text(), text);
      }
      return;
    case Settings::Kind::list:
      text += '[';
      for (const Settings& item : settings.items()) {
        if (&item != &settings.items().front()) text += ',';
        append_canonical(item, text);
      }
      text += ']';
      return;
    case Settings::Kind::map: {
      std::vector<const Settings::Member*> members;
      for (const Settings::Member& member : settings.members()) members.push_back(&member);
      std::sort(members.begin(), members.end(), [](const auto* a, const auto* b) { return a->first < b->first; });
      text += '{';
      for (const Settings::Member* member : members) {
        if (member != members.front()) text += ',';
        append_quoted(member->first, text);
        text += ':';
        append_canonical(member->second, text);
      }
      text += '}';
      return;
    }
  }
}

}  // namespace

std::string canonical_text(const Settings& settings) {
  std::string text;
  append_canonical(settings, text);
  return text;
}

RunIdentity identity_of(std::string_view configuration) {
  std::array<unsigned char, 32> digest{};
  if (EVP_Digest(configuration.data(), configuration.size(), digest.data(), nullptr, EVP_sha256(), nullptr) != 1)
    throw Error("sweep: OpenSSL's library has no SHA-256; install libssl3 anew");
  const auto word = [&](std::size_t first) {
    std::uint64_t bits = 0;
    for (std::size_t i = first; i < first + 8; ++i) bits = bits << 8 | digest[i];
    return bits;
  };
  return {word(0), word(8)};
}

std::string RunIdentity::text() const { return fmt::format("{:016x}{:016x}", high, low); }

}  // namespace rhec::sim
