#include "rhec/core/config/settings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "rhec/core/base/infinity.hpp"

namespace rhec {
namespace {

std::string key_path(const std::string& parent, std::string_view key) {
  return parent.empty() ? std::string(key) : fmt::format("{}.{}", parent, key);
}

std::string item_path(const std::string& parent, std::size_t index) { return fmt::format("{}[{}]", parent, index); }

/// Reads the whole of `text`. Accepts a leading plus, unlike from_chars.
template <class Number>
std::optional<Number> read_whole(std::string_view text) noexcept {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  Number value{};
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (problem != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

template <class Value, class Read>
std::vector<Value> read_each(const Settings& list, std::string_view expected, Read read) {
  if (list.kind() != Settings::Kind::list) throw list.mismatch(expected);
  std::vector<Value> values;
  values.reserve(list.items().size());
  for (const Settings& item : list.items()) values.push_back(read(item));
  return values;
}

}  // namespace

Settings::Settings(const Settings&) = default;
Settings::Settings(Settings&&) noexcept = default;
Settings& Settings::operator=(const Settings&) = default;
Settings& Settings::operator=(Settings&&) noexcept = default;
Settings::~Settings() = default;

Settings Settings::null(Origin origin) {
  Settings node;
  node.origin_ = std::move(origin);
  return node;
}

Settings Settings::scalar(std::string text, Origin origin) {
  Settings node = null(std::move(origin));
  node.kind_ = Kind::scalar;
  node.text_ = std::move(text);
  return node;
}

Settings Settings::list(Origin origin) {
  Settings node = null(std::move(origin));
  node.kind_ = Kind::list;
  return node;
}

Settings Settings::map(Origin origin) {
  Settings node = null(std::move(origin));
  node.kind_ = Kind::map;
  return node;
}

const Settings* Settings::find(std::string_view key) const noexcept {
  const auto at = std::find_if(members_.begin(), members_.end(), [&](const Member& m) { return m.first == key; });
  return at == members_.end() ? nullptr : &at->second;
}

const Settings* Settings::find_path(std::string_view dotted) const noexcept {
  const Settings* node = this;
  while (node != nullptr) {
    const std::size_t dot = dotted.find('.');
    node = node->find(dotted.substr(0, dot));
    if (dot == std::string_view::npos) return node;
    dotted.remove_prefix(dot + 1);
  }
  return nullptr;
}

void Settings::set(std::string_view dotted, Settings value) {
  const std::size_t dot = dotted.find('.');
  const std::string key(dotted.substr(0, dot));
  if (key.empty() || dot + 1 == dotted.size()) {
    throw value.error("a key path is empty or has an empty part; write keys joined by single dots, e.g. a.b.c");
  }
  if (kind_ != Kind::null && kind_ != Kind::map) {
    throw value.error(fmt::format("cannot set '{}' there: {} is {}, written at {}; only a map has keys",
                                  key_path(path_, dotted), path_.empty() ? "the root" : "'" + path_ + "'", found(),
                                  where()));
  }
  if (kind_ == Kind::null && origin_.file.empty()) origin_ = value.origin_;
  kind_ = Kind::map;
  auto at = std::find_if(members_.begin(), members_.end(), [&](const Member& m) { return m.first == key; });
  if (dot == std::string_view::npos) {
    value.move_to(key_path(path_, key));
    if (at == members_.end()) {
      members_.emplace_back(key, std::move(value));
    } else {
      at->second = std::move(value);
    }
    return;
  }
  if (at != members_.end()) return at->second.set(dotted.substr(dot + 1), std::move(value));
  Settings child = map(value.origin_);
  child.path_ = key_path(path_, key);
  child.set(dotted.substr(dot + 1), std::move(value));  // before it is attached, so that nothing changes if this throws
  members_.emplace_back(key, std::move(child));
}

void Settings::add(std::string key, Settings value) {
  become(Kind::map, "take a key");
  value.move_to(key_path(path_, key));
  if (const Settings* before = find(key)) {
    throw value.error(fmt::format("the key is written twice, first at {}; keep one of them", before->where()));
  }
  members_.emplace_back(std::move(key), std::move(value));
}

void Settings::append(Settings value) {
  become(Kind::list, "take an item");
  value.move_to(item_path(path_, items_.size()));
  items_.push_back(std::move(value));
}

std::string Settings::where() const {
  if (origin_.file.empty()) return "settings";
  return origin_.line > 0 ? fmt::format("{}:{}", origin_.file, origin_.line) : origin_.file;
}

std::optional<double> Settings::number() const noexcept {
  if (kind_ != Kind::scalar) return std::nullopt;
  if (text_ == ".inf" || text_ == "+.inf" || text_ == "inf" || text_ == "+inf") return infinity;
  if (text_ == "-.inf" || text_ == "-inf") return -infinity;
  const std::optional<double> value = read_whole<double>(text_);
  // from_chars also reads 'nan' and 'infinity'; neither is accepted as a number here.
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::optional<int> Settings::integer() const noexcept {
  return kind_ == Kind::scalar ? read_whole<int>(text_) : std::nullopt;
}

std::optional<bool> Settings::flag() const noexcept {
  if (kind_ == Kind::scalar && text_ == "true") return true;
  if (kind_ == Kind::scalar && text_ == "false") return false;
  return std::nullopt;
}

double Settings::as_number() const {
  if (const auto value = number()) return *value;
  throw mismatch("a number");
}

int Settings::as_integer() const {
  if (const auto value = integer()) return *value;
  throw mismatch("an integer");
}

bool Settings::as_flag() const {
  if (const auto value = flag()) return *value;
  throw mismatch("true or false");
}

const std::string& Settings::as_text() const {
  if (kind_ != Kind::scalar) throw mismatch("a text");
  return text_;
}

std::vector<double> Settings::as_numbers() const {
  return read_each<double>(*this, "a list of numbers", [](const Settings& item) { return item.as_number(); });
}

std::vector<int> Settings::as_integers() const {
  return read_each<int>(*this, "a list of integers", [](const Settings& item) { return item.as_integer(); });
}

std::vector<std::string> Settings::as_names() const {
  return read_each<std::string>(*this, "a list of names", [](const Settings& item) { return item.as_text(); });
}

namespace {

/// As much of a text as helps to find it.
std::string shortened(const std::string& text) {
  constexpr std::size_t most = 200, kept = 60;
  if (text.size() <= most) return text;
  std::size_t end = kept;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;  // not within a letter of UTF-8
  return fmt::format("{}...", text.substr(0, end));
}

}  // namespace

std::string Settings::found() const {
  switch (kind_) {
    case Kind::null:
      return "nothing";
    case Kind::scalar:
      return fmt::format("'{}'", shortened(text_));
    case Kind::list:
      return fmt::format("a list of {}", items_.size());
    case Kind::map:
      return "a map";
  }
  return "nothing";
}

Error Settings::error(std::string_view what) const {
  return Error(path_.empty() ? fmt::format("{}: {}", where(), what) : fmt::format("{}: {}: {}", where(), path_, what));
}

Error Settings::mismatch(std::string_view expected) const {
  return error(fmt::format("found {}, expected {}", found(), expected));
}

void Settings::become(Kind kind, std::string_view verb) {
  if (kind_ != Kind::null && kind_ != kind) throw error(fmt::format("{} cannot {}", found(), verb));
  kind_ = kind;
}

void Settings::move_to(std::string path) {
  for (std::size_t i = 0; i < items_.size(); ++i) items_[i].move_to(item_path(path, i));
  for (auto& [key, value] : members_) value.move_to(key_path(path, key));
  path_ = std::move(path);
}

}  // namespace rhec
