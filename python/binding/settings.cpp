#include "settings.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <filesystem>

#include "binding.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::python {
namespace {

namespace py = pybind11;

std::string number_text(double value) {
  if (std::isfinite(value)) return fmt::format("{}", value);
  return value > 0.0 ? ".inf" : "-.inf";
}

class Reader {
 public:
  explicit Reader(std::string origin) : origin_{std::move(origin), 0} {}

  Settings read(py::handle object, const std::string& path) const {
    if (object.is_none()) return Settings::null(origin_);
    if (py::isinstance<py::bool_>(object)) return Settings::scalar(object.cast<bool>() ? "true" : "false", origin_);
    if (py::isinstance<py::str>(object)) return Settings::scalar(text_of(object, path), origin_);
    if (py::isinstance<py::int_>(object)) return Settings::scalar(py::str(object), origin_);
    if (py::isinstance<py::float_>(object)) return read_number(object.cast<double>(), path);
    if (py::isinstance<py::dict>(object)) return read_map(py::reinterpret_borrow<py::dict>(object), path);
    if (py::isinstance<py::list>(object) || py::isinstance<py::tuple>(object)) return read_list(object, path);
    if (py::hasattr(object, "tolist")) return read(object.attr("tolist")(), path);  // numpy: arrays and numbers
    throw mistake(path,
                  fmt::format("found an object of the class '{}', expected None, a number, a text, a list or a dict",
                              py::type::of(object).attr("__name__").cast<std::string>()));
  }

 private:
  Error mistake(const std::string& path, const std::string& what) const {
    return Error(path.empty() ? fmt::format("{}: {}", origin_.file, what)
                              : fmt::format("{}: {}: {}", origin_.file, path, what));
  }
  std::string text_of(py::handle text, const std::string& path) const {
    py::ssize_t size = 0;
    const char* letters = PyUnicode_AsUTF8AndSize(text.ptr(), &size);
    if (letters != nullptr) return {letters, static_cast<std::size_t>(size)};
    PyErr_Clear();
    throw mistake(path,
                  fmt::format("found the text {}, which is not Unicode; expected one that can be written as UTF-8",
                              py::str(py::module_::import("builtins").attr("ascii")(text)).cast<std::string>()));
  }
  Settings read_number(double value, const std::string& path) const {
    if (std::isnan(value)) throw mistake(path, "found NaN, expected a number");
    return Settings::scalar(number_text(value), origin_);
  }
  Settings read_map(const py::dict& dict, const std::string& path) const {
    Settings map = Settings::map(origin_);
    for (const auto& [key, value] : dict) {
      if (!py::isinstance<py::str>(key))
        throw mistake(path, fmt::format("found the key {}, expected a text", py::repr(key).cast<std::string>()));
      const std::string name = text_of(key, path);
      map.add(name, read(value, path.empty() ? name : fmt::format("{}.{}", path, name)));
    }
    return map;
  }
  Settings read_list(py::handle object, const std::string& path) const {
    Settings list = Settings::list(origin_);
    std::size_t index = 0;
    for (const py::handle item : object) list.append(read(item, fmt::format("{}[{}]", path, index++)));
    return list;
  }

  Origin origin_;
};

py::object scalar_object(const Settings& scalar) {
  if (const auto flag = scalar.flag()) return py::bool_(*flag);
  if (const auto number = scalar.integer()) return py::int_(*number);
  if (const auto number = scalar.number()) return py::float_(*number);
  return py::str(scalar.text());
}

}  // namespace

Settings settings_of(py::handle object, const std::string& origin) { return Reader(origin).read(object, ""); }

py::object object_of(const Settings& settings) {
  switch (settings.kind()) {
    case Settings::Kind::null:
      return py::none();
    case Settings::Kind::scalar:
      return scalar_object(settings);
    case Settings::Kind::list: {
      py::list list;
      for (const Settings& item : settings.items()) list.append(object_of(item));
      return list;
    }
    case Settings::Kind::map:
      break;
  }
  py::dict map;
  for (const auto& [key, value] : settings.members()) map[py::str(key)] = object_of(value);
  return map;
}

void bind_settings(py::module_& module) {
  py::class_<Settings>(module, "Settings", "A configuration, each part of which knows where it was written.")
      .def_static(
          "load", [](const std::string& file) { return load_scenario(file); }, py::arg("file"),
          "Reads a scenario, and the robot that it names.")
      .def_static(
          "read", [](const std::string& file) { return load_yaml(file); }, py::arg("file"),
          "Reads a file of another kind than a scenario, such as a sweep.")
      .def_static("of", &settings_of, py::arg("object"), py::arg("origin"), "Of dicts, lists, numbers and texts.")
      .def(
          "set",
          [](Settings& self, const std::string& key, const py::object& value) {
            self.set(key, settings_of(value, fmt::format("set '{}'", key)));
          },
          py::arg("key"), py::arg("value"), "Sets the value at a dotted key, such as 'estimator.horizon'.")
      .def("to_object", &object_of, "The same as dicts, lists, numbers and texts.");
}

}  // namespace rhec::python
