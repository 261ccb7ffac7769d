#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/export.hpp"

namespace rhec {

/// Where a part of the configuration was written.
struct Origin {
  std::string file;  ///< a file name or its equivalent, e.g. "--set horizon.length=25"
  int line = 0;      ///< counted from 1; 0 if there are no lines
};

/// A configuration tree in which each node knows where it was written, so that every error can say so.
///
/// A node is null, a scalar (text, interpreted only when it is read), a list, or a map that keeps the order of its
/// keys. A node copied out of a tree keeps its key path. This class does not read files: see
/// rhec/plugins/yaml/yaml.hpp.
class RHEC_EXPORT Settings {
 public:
  enum class Kind { null, scalar, list, map };
  using Member = std::pair<std::string, Settings>;

  Settings() = default;  ///< null
  // Trees are copied in many places: compiled once, and not for each.
  Settings(const Settings&);
  Settings(Settings&&) noexcept;
  Settings& operator=(const Settings&);
  Settings& operator=(Settings&&) noexcept;
  ~Settings();
  static Settings null(Origin origin = {});
  static Settings scalar(std::string text, Origin origin = {});
  static Settings list(Origin origin = {});
  static Settings map(Origin origin = {});

  Kind kind() const noexcept { return kind_; }
  bool is_null() const noexcept { return kind_ == Kind::null; }
  const std::string& text() const noexcept { return text_; }                 ///< empty unless a scalar
  const std::vector<Settings>& items() const& noexcept { return items_; }    ///< empty unless a list
  const std::vector<Member>& members() const& noexcept { return members_; }  ///< empty unless a map
  // A loop over the children of a temporary would outlive it.
  void items() && = delete;
  void members() && = delete;

  /// The map's value at `key`; null if there is none.
  const Settings* find(std::string_view key) const noexcept;
  /// The node at a dotted path such as "estimator.horizon.length"; null if there is none.
  const Settings* find_path(std::string_view dotted) const noexcept;

  /// Sets the value at a dotted path, replacing what was there; missing or null nodes on the way become maps. Throws
  /// Error if the path is malformed or leads through a scalar or a list.
  void set(std::string_view dotted, Settings value);
  /// Adds one key (verbatim, dots included) to a map; null becomes a map. Throws Error if the key already exists,
  /// naming both places.
  void add(std::string key, Settings value);
  /// Adds an item to a list; null becomes a list. Throws Error on anything else.
  void append(Settings value);

  const Origin& origin() const noexcept { return origin_; }
  std::string where() const;                                  ///< "scenarios/figure8.yaml:12"
  const std::string& path() const noexcept { return path_; }  ///< "estimator.noise[2]"; empty at the root

  /// Scalar values; empty if the text cannot be read as such. Numbers must be complete, in C notation; infinity is
  /// written `.inf` or `inf`; NaN is rejected.
  std::optional<double> number() const noexcept;
  std::optional<int> integer() const noexcept;
  std::optional<bool> flag() const noexcept;  ///< `true` or `false`

  /// The same, but throw Error that says where it is, what was found and what was expected.
  double as_number() const;
  int as_integer() const;
  bool as_flag() const;
  const std::string& as_text() const;
  std::vector<double> as_numbers() const;     ///< of a list
  std::vector<int> as_integers() const;       ///< of a list
  std::vector<std::string> as_names() const;  ///< of a list of scalars

  /// Describes the node in messages: "'five'", "nothing", "a list of 3", "a map".
  std::string found() const;
  /// An error at this node: "file:12: key.path: " followed by `what`.
  Error error(std::string_view what) const;
  /// An error of the common form: "file:12: key.path: found 'five', expected a number".
  Error mismatch(std::string_view expected) const;

 private:
  void become(Kind kind, std::string_view verb);
  void move_to(std::string path);

  Kind kind_ = Kind::null;
  std::string text_;
  std::vector<Settings> items_;
  std::vector<Member> members_;
  Origin origin_;
  std::string path_;
};

}  // namespace rhec
