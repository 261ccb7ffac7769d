#include "rhec/logs/cdr/message_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "field_path.hpp"
#include "rhec/logs/cdr/cdr_cursor.hpp"
#include "rhec/logs/signals/clock.hpp"

namespace rhec::logs {
struct StructureWant;

/// One item of an array that is asked for.
struct ItemWant {
  std::optional<std::uint64_t> index;  ///< none: found by `key`
  int key = -1;                        ///< among the keys of the structure, for numbers
  std::string name;                    ///< of an item that is a structure
  int slot = -1;
  std::unique_ptr<StructureWant> inner;
};

struct FieldWant {
  int slot = -1;                         ///< of a single number
  std::unique_ptr<StructureWant> inner;  ///< of a single structure
  std::vector<ItemWant> items;
};

struct StructureWant {
  std::vector<std::unique_ptr<FieldWant>> fields;
  int last = -1;         ///< the last field that is asked for
  int names_field = -1;  ///< the list that names the items of others
  std::vector<std::string> keys;
  std::vector<std::int64_t> places;  ///< by key, in the message that is being read; -1: not there
};

namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();
constexpr std::string_view header_type = "std_msgs/msg/Header", time_type = "builtin_interfaces/msg/Time";

bool is_number(Kind kind) { return size_of(kind) > 0; }

std::vector<std::string> names_of_fields(const StructureDefinition& structure) {
  std::vector<std::string> names;
  for (const FieldDefinition& field : structure.fields) names.push_back(field.name);
  return names;
}

/// The field by which items of a structure are told apart, or -1.
int key_field(const StructureDefinition& structure) {
  for (const char* name : {"name", "child_frame_id", "id"})
    for (std::size_t i = 0; i < structure.fields.size(); ++i)
      if (structure.fields[i].name == name && structure.fields[i].kind == Kind::text &&
          structure.fields[i].shape == Shape::single)
        return static_cast<int>(i);
  return -1;
}

/// The list of names in a structure, before the field `before`, or -1.
int names_field(const StructureDefinition& structure, std::size_t before) {
  for (std::size_t i = 0; i < before; ++i) {
    const FieldDefinition& field = structure.fields[i];
    if (field.kind == Kind::text && field.shape == Shape::sequence &&
        (field.name == "name" || field.name == "names" || field.name == "joint_names"))
      return static_cast<int>(i);
  }
  return -1;
}

/// Makes wants of paths.
class WantBuilder {
 public:
  explicit WantBuilder(const MessageType& type) : type_(type) {}

  void add(const std::string& path, int slot, StructureWant& root) {
    path_ = path;
    steps_ = parse_path(path);
    add_step(0, 0, slot, root);
  }

  static void prepare(const StructureDefinition& structure, StructureWant& want) {
    want.fields.resize(structure.fields.size());
  }

 private:
  void add_step(std::size_t step, int structure_index, int slot, StructureWant& want) {
    const StructureDefinition& structure = type_.structures[static_cast<std::size_t>(structure_index)];
    prepare(structure, want);
    const std::vector<std::string> names = names_of_fields(structure);
    const auto found = std::find(names.begin(), names.end(), steps_[step].name);
    if (found == names.end())
      throw Error(fmt::format("{} has no field '{}' in '{}'{}", structure.name, steps_[step].name, path_,
                              suggestion_for(steps_[step].name, names)));
    const auto place = static_cast<std::size_t>(found - names.begin());
    const FieldDefinition& field = structure.fields[place];
    if (!want.fields[place]) want.fields[place] = std::make_unique<FieldWant>();
    want.last = std::max(want.last, static_cast<int>(place));
    const bool is_last = step + 1 == steps_.size();
    const bool has_item = steps_[step].item.has_value();
    if (has_item != (field.shape != Shape::single) || is_last != is_number(field.kind)) refuse(field, step);
    int* target = &want.fields[place]->slot;
    std::unique_ptr<StructureWant>* inner = &want.fields[place]->inner;
    if (has_item) {
      ItemWant& item = add_item(structure, place, *steps_[step].item, want);
      target = &item.slot;
      inner = &item.inner;
    }
    if (is_last) {
      *target = slot;
      return;
    }
    if (!*inner) *inner = std::make_unique<StructureWant>();
    add_step(step + 1, field.structure, slot, **inner);
  }

  ItemWant& add_item(const StructureDefinition& structure, std::size_t place, const std::string& text,
                     StructureWant& want) {
    const FieldDefinition& field = structure.fields[place];
    std::vector<ItemWant>& items = want.fields[place]->items;
    ItemWant item{.index = index_in(text), .key = -1, .name = text, .slot = -1, .inner = nullptr};
    if (field.kind == Kind::structure) {  // two paths may lead into one item
      const auto same =
          std::find_if(items.begin(), items.end(), [&](const ItemWant& each) { return each.name == text; });
      if (same != items.end()) return *same;
    }
    if (field.shape == Shape::array && item.index && *item.index >= field.length)
      throw Error(fmt::format("'{}': {} has {} items; expected an index below that", path_, field.name, field.length));
    if (!item.index && field.kind != Kind::structure) {
      want.names_field = names_field(structure, place);
      if (want.names_field < 0)
        throw Error(fmt::format("'{}': {} has no list of names; expected an index instead of '{}'", path_,
                                structure.name, text));
      item.key = static_cast<int>(want.keys.size());
      want.keys.push_back(text);
      want.places.push_back(-1);
    }
    if (!item.index && field.kind == Kind::structure &&
        key_field(type_.structures[static_cast<std::size_t>(field.structure)]) < 0)
      throw Error(fmt::format("'{}': a {} has no name; expected an index instead of '{}'", path_, field.type, text));
    return items.emplace_back(std::move(item));
  }

  [[noreturn]] void refuse(const FieldDefinition& field, std::size_t step) const {
    const std::string& name = steps_[step].name;
    if (field.shape != Shape::single && !steps_[step].item)
      throw Error(fmt::format("'{}': {} is a list; expected one of its items, e.g. {}[0]", path_, name, name));
    if (field.shape == Shape::single && steps_[step].item)
      throw Error(fmt::format("'{}': {} is no list; expected it without [{}]", path_, name, *steps_[step].item));
    if (field.kind == Kind::structure)
      throw Error(
          fmt::format("'{}': {} is a {}, not a number; expected one of its fields: {}", path_, name, field.type,
                      fmt::join(names_of_fields(type_.structures[static_cast<std::size_t>(field.structure)]), ", ")));
    if (is_number(field.kind))
      throw Error(fmt::format("'{}': {} is a number, and has no field '{}'", path_, name, steps_[step + 1].name));
    throw Error(fmt::format("'{}': {} is a text; expected a number", path_, name));
  }

  const MessageType& type_;
  std::string path_;
  std::vector<PathStep> steps_;
};

/// Goes through a message.
class Walker {
 public:
  Walker(const MessageType& type, CdrCursor& cursor) : type_(type), cursor_(cursor) {}

  /// `to_end`: whether something behind the structure is asked for.
  void read(int index, StructureWant& want, double* values, bool to_end) {
    const StructureDefinition& structure = structure_at(index);
    const auto count = to_end ? structure.fields.size() : static_cast<std::size_t>(want.last + 1);
    for (std::size_t i = 0; i < count; ++i) {
      if (static_cast<int>(i) == want.names_field) {
        read_names(want);
      } else if (want.fields[i]) {
        read_field(structure.fields[i], *want.fields[i], want, values, to_end || i + 1 < count);
      } else {
        skip(structure.fields[i]);
      }
    }
    if (to_end && structure.fields.empty()) cursor_.skip_byte();
  }

  void skip_structure(int index) {
    const StructureDefinition& structure = structure_at(index);
    for (const FieldDefinition& field : structure.fields) skip(field);
    if (structure.fields.empty()) cursor_.skip_byte();  // CDR has no empty structures
  }

  std::uint64_t count_of(const FieldDefinition& field) {
    if (field.shape == Shape::single) return 1;
    if (field.shape == Shape::array) return field.length;
    const std::size_t size = size_of(field.kind);
    return cursor_.length(size > 0 ? size : field.kind == Kind::structure ? 1 : 4);
  }

  void skip(const FieldDefinition& field) {
    const std::uint64_t count = count_of(field);
    if (is_number(field.kind)) return cursor_.skip_numbers(field.kind, count);
    for (std::uint64_t i = 0; i < count; ++i) skip_item(field);
  }

  /// The name by which the structure that comes next can be asked for; empty: it has none.
  std::string peek_name(int index) {
    if (key_field(structure_at(index)) < 0) return {};
    const std::size_t place = cursor_.place();
    std::string name(key_at(index));
    cursor_.go_to(place);
    return index_in(name) ? std::string() : name;
  }

  void skip_item(const FieldDefinition& field) {
    if (field.kind == Kind::structure) {
      skip_structure(field.structure);
    } else if (field.kind == Kind::text) {
      cursor_.skip_text();
    } else if (is_number(field.kind)) {
      cursor_.skip_numbers(field.kind, 1);
    } else {
      throw RecordError(
          fmt::format("found the field '{}', a wstring or long double, whose encoding differs between "
                      "vendors; expected none of these before the fields that are asked for",
                      field.name));
    }
  }

 private:
  const StructureDefinition& structure_at(int index) const { return type_.structures[static_cast<std::size_t>(index)]; }

  void read_names(StructureWant& want) {
    std::fill(want.places.begin(), want.places.end(), -1);
    const std::uint64_t count = cursor_.length(4);
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::string_view name = cursor_.text();
      for (std::size_t key = 0; key < want.keys.size(); ++key)
        if (want.keys[key] == name) want.places[key] = static_cast<std::int64_t>(i);
    }
  }

  void read_field(const FieldDefinition& field, FieldWant& want, StructureWant& owner, double* values, bool to_end) {
    if (field.shape == Shape::single) {
      if (is_number(field.kind)) {
        values[want.slot] = cursor_.number(field.kind);
      } else {
        read(field.structure, *want.inner, values, to_end);
      }
      return;
    }
    const std::uint64_t count = count_of(field);
    if (is_number(field.kind)) {
      read_numbers(field, want, owner, count, values);
    } else {
      for (std::uint64_t i = 0; i < count; ++i) read_item(field, want, i, values);
    }
  }

  void read_numbers(const FieldDefinition& field, const FieldWant& want, const StructureWant& owner,
                    std::uint64_t count, double* values) {
    if (count == 0) return;
    cursor_.align(field.kind);
    const std::size_t begin = cursor_.place();
    cursor_.skip_numbers(field.kind, count);
    const std::size_t end = cursor_.place();
    for (const ItemWant& item : want.items) {
      const std::int64_t named = item.key >= 0 ? owner.places[static_cast<std::size_t>(item.key)] : -1;
      if (item.key >= 0 && named < 0) continue;
      const std::uint64_t index = item.key >= 0 ? static_cast<std::uint64_t>(named) : *item.index;
      if (index >= count) continue;
      cursor_.go_to(begin + static_cast<std::size_t>(index) * size_of(field.kind));
      values[item.slot] = cursor_.number(field.kind);
    }
    cursor_.go_to(end);
  }

  void read_item(const FieldDefinition& field, FieldWant& want, std::uint64_t index, double* values) {
    const std::size_t begin = cursor_.place();
    skip_structure(field.structure);
    const std::size_t end = cursor_.place();
    for (ItemWant& item : want.items) {
      cursor_.go_to(begin);
      if (item.index ? *item.index == index : key_at(field.structure) == item.name) {
        cursor_.go_to(begin);
        read(field.structure, *item.inner, values, true);
      }
    }
    cursor_.go_to(end);
  }

  std::string_view key_at(int index) {
    const StructureDefinition& structure = structure_at(index);
    const auto key = static_cast<std::size_t>(key_field(structure));
    for (std::size_t i = 0; i < key; ++i) skip(structure.fields[i]);
    return cursor_.text();
  }

  const MessageType& type_;
  CdrCursor& cursor_;
};

/// Whether a path leads to a time: "header.stamp".
bool leads_to_time(const MessageType& type, const std::string& path) {
  int structure = 0;
  for (const PathStep& step : parse_path(path)) {
    if (structure < 0) return false;
    int next = -1;
    for (const FieldDefinition& field : type.structures[static_cast<std::size_t>(structure)].fields)
      if (field.name == step.name && (field.shape == Shape::single) != step.item.has_value()) next = field.structure;
    structure = next;
  }
  return structure >= 0 && type.structures[static_cast<std::size_t>(structure)].name == time_type;
}

std::string own_clock(const MessageType& type) {
  const std::vector<FieldDefinition>& fields = type.structures.front().fields;
  const bool has_header =
      !fields.empty() && fields.front().type == header_type && fields.front().shape == Shape::single;
  return has_header ? fields.front().name + ".stamp" : "";
}

/// Finds all numbers of a message.
class PathLister {
 public:
  PathLister(const MessageType& type, CdrCursor& cursor) : type_(type), cursor_(cursor), walker_(type, cursor) {}

  void list(int index, const std::string& prefix, int depth) {
    const StructureDefinition& structure = type_.structures[static_cast<std::size_t>(index)];
    std::vector<std::string> names;  // of the items of later fields
    for (std::size_t i = 0; i < structure.fields.size(); ++i) {
      const FieldDefinition& field = structure.fields[i];
      const bool is_list_of_names = names_field(structure, i + 1) == static_cast<int>(i);
      if (is_list_of_names) {
        names = take_names();
      } else if (depth > deepest || field.type == header_type || found.size() >= most_paths) {
        walker_.skip(field);
      } else {
        list_field(field, prefix + field.name, names, depth);
      }
    }
    if (structure.fields.empty()) cursor_.skip_byte();
  }

  std::vector<std::string> found;

 private:
  static constexpr std::size_t most_paths = 100, longest_list = 16;
  static constexpr int deepest = 8;

  std::vector<std::string> take_names() {
    std::vector<std::string> names;
    for (std::uint64_t left = cursor_.length(4); left > 0; --left) {
      const std::string_view name = cursor_.text();
      if (names.size() < longest_list) names.emplace_back(name);
    }
    return names;
  }

  void list_field(const FieldDefinition& field, const std::string& path, const std::vector<std::string>& names,
                  int depth) {
    const std::uint64_t count = walker_.count_of(field);
    const bool is_shown = count <= longest_list;
    std::set<std::string> taken;  // of items that have names of their own
    for (std::uint64_t i = 0; i < count; ++i) {
      std::string item = path;
      const bool is_named = i < names.size() && is_number(field.kind) && names[i].find(']') == std::string::npos;
      std::string own;
      if (field.shape == Shape::sequence && field.kind == Kind::structure && is_shown)
        own = walker_.peek_name(field.structure);
      if (own.find_first_of("[]") != std::string::npos || !taken.insert(own).second) own.clear();
      if (field.shape != Shape::single)
        item += is_named       ? fmt::format("[{}]", names[i])
                : !own.empty() ? fmt::format("[{}]", own)
                               : fmt::format("[{}]", i);
      if (is_number(field.kind)) {
        if (!is_shown) return cursor_.skip_numbers(field.kind, count);
        cursor_.skip_numbers(field.kind, 1);
        found.push_back(item);
      } else if (field.kind == Kind::structure && is_shown) {
        list(field.structure, item + ".", depth + 1);
      } else {
        walker_.skip_item(field);
      }
    }
  }

  const MessageType& type_;
  CdrCursor& cursor_;
  Walker walker_;
};

}  // namespace

struct MessageReader::Parts {
  std::shared_ptr<const MessageType> type;
  StructureWant want;
  std::size_t fields = 0;
  std::vector<double> clock;  ///< values of the clock's fields
  ClockUnit unit = 0.0;
  bool has_clock = false, is_time = false;
  std::vector<int> slot_of;  ///< by field, the slot that holds it: a field may be asked for twice
  std::vector<double> values;
};

MessageReader::MessageReader(std::shared_ptr<const MessageType> type, const FieldRequest& request)
    : parts_(std::make_unique<Parts>()) {
  Parts& parts = *parts_;
  parts.type = std::move(type);
  parts.fields = request.fields.size();
  WantBuilder builder(*parts.type);
  WantBuilder::prepare(parts.type->structures.front(), parts.want);
  std::map<std::string, int> slots;
  const auto slot_of = [&](const std::string& path) {
    const auto [at, is_new] = slots.try_emplace(path, static_cast<int>(slots.size()));
    if (is_new) builder.add(path, at->second, parts.want);
    return at->second;
  };
  for (const std::string& field : request.fields) parts.slot_of.push_back(slot_of(field));
  const bool is_received = request.clock == received_clock;
  const ClockName clock =
      request.clock.empty() || is_received ? ClockName{own_clock(*parts.type), ""} : parse_clock_name(request.clock);
  if (!is_received && !clock.name.empty()) {
    parts.has_clock = true;
    parts.is_time = leads_to_time(*parts.type, clock.name);
    const auto unit = clock_unit(clock.unit);
    if (!unit) throw Error(fmt::format("the clock '{}': expected [s], [ms], [us] or [ns]", request.clock));
    parts.unit = *unit;
    for (const char* part : {".sec", ".nanosec"}) {
      parts.slot_of.push_back(slot_of(parts.is_time ? clock.name + part : clock.name));
      if (!parts.is_time) break;
    }
  }
  parts.values.resize(slots.size());
}

MessageReader::~MessageReader() = default;

Stamp MessageReader::read(const Record& record, double* values) {
  Parts& parts = *parts_;
  std::fill(parts.values.begin(), parts.values.end(), missing);
  CdrCursor cursor(record.bytes);
  Walker(*parts.type, cursor).read(0, parts.want, parts.values.data(), false);
  const auto value = [&](std::size_t i) { return parts.values[static_cast<std::size_t>(parts.slot_of[i])]; };
  for (std::size_t i = 0; i < parts.fields; ++i) values[i] = value(i);
  if (!parts.has_clock) return record.received;
  if (parts.is_time) {
    const double sec = value(parts.fields), nanosec = value(parts.fields + 1);
    // A stamp that nobody has set.
    if (sec == 0.0 && nanosec == 0.0) return record.received;
    constexpr double most_seconds = 9e9;
    if (!(std::abs(sec) < most_seconds && nanosec >= 0.0 && nanosec < most_seconds)) return no_stamp;
    return static_cast<Stamp>(sec) * 1'000'000'000 + static_cast<Stamp>(nanosec);
  }
  return stamp_of(value(parts.fields), parts.unit).value_or(no_stamp);
}

std::vector<std::string> number_paths(const MessageType& type, std::span<const std::byte> message) {
  CdrCursor cursor(message);
  PathLister lister(type, cursor);
  lister.list(0, "", 0);
  return std::move(lister.found);
}

}  // namespace rhec::logs
