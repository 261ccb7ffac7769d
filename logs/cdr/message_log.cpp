#include "rhec/logs/cdr/message_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "message_finder.hpp"
#include "rhec/logs/cdr/message_reader.hpp"

namespace rhec::logs {

MessageLog::MessageLog(std::string name, MessageLogOptions options)
    : Log(std::move(name)), options_(std::move(options)) {
  for (const std::filesystem::path& folder : options_.msg_paths)
    if (!std::filesystem::is_directory(folder))
      throw Error(
          fmt::format("--msg-path {}: found no folder; give one that holds packages with .msg files", folder.string()));
}

MessageLog::Place MessageLog::add_topic(const std::string& name, const std::string& type, MessageEncoding encoding) {
  const std::string full = full_type_name(type);
  std::size_t topic = 0;
  while (topic < topics_.size() && (topics_[topic].name != name || topics_[topic].type != full)) ++topic;
  if (topic == topics_.size()) {
    topics_.push_back({.name = name, .type = full});
    forms_.emplace_back();
  }
  std::vector<Form>& forms = forms_[topic];
  std::size_t form = 0;
  while (form < forms.size() && !(forms[form].encoding == encoding)) ++form;
  if (form == forms.size()) forms.push_back({std::move(encoding)});
  return {static_cast<int>(topic), static_cast<int>(form)};
}

std::shared_ptr<const MessageType> MessageLog::type_of(int topic, int form) const {
  const auto i = static_cast<std::size_t>(topic);
  const Form& found = forms_[i][static_cast<std::size_t>(form)];
  if (found.type) return found.type;
  const MessageEncoding& encoding = found.encoding;
  try {
    if (encoding.serialization == "ros1")
      throw Error(
          "its messages are those of ROS 1; convert the bag by `rosbags-convert` of the Python package 'rosbags'");
    if (encoding.serialization != "cdr")
      throw Error(fmt::format("its messages are in {}; expected cdr", in_quotes(encoding.serialization)));
    found.type = find_message(topics_[i].type, encoding.schema_encoding, encoding.schema, options_.msg_paths);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: topic {}: {}", name(), topics_[i].name, error.what()));
  }
  return found.type;
}

namespace {

/// Reads messages of a type that was defined anew: each by its own definition. What a definition does not have is NaN.
class FormReader final : public FieldReader {
 public:
  /// Throws Error for a field that none of the definitions has.
  FormReader(const std::vector<std::shared_ptr<const MessageType>>& types, const FieldRequest& request)
      : fields_(request.fields.size()) {
    std::vector<bool> is_known(fields_);
    for (const std::shared_ptr<const MessageType>& type : types) {
      Form form;
      FieldRequest own{.fields = {}, .clock = request.clock};
      for (std::size_t i = 0; i < fields_; ++i) {
        if (!has(type, request.fields[i])) continue;
        own.fields.push_back(request.fields[i]);
        form.slots.push_back(i);
        is_known[i] = true;
      }
      form.values.resize(own.fields.size());
      form.reader = std::make_unique<MessageReader>(type, own);
      forms_.push_back(std::move(form));
    }
    for (std::size_t i = 0; i < fields_; ++i)
      if (!is_known[i])
        MessageReader(types.front(), {.fields = {request.fields[i]}, .clock = {}});  // says what is wrong
  }
  Stamp read(const Record& record, double* values) override {
    Form& form = forms_[static_cast<std::size_t>(record.form)];
    const Stamp stamp = form.reader->read(record, form.values.data());
    std::fill_n(values, fields_, std::numeric_limits<double>::quiet_NaN());
    for (std::size_t i = 0; i < form.slots.size(); ++i) values[form.slots[i]] = form.values[i];
    return stamp;
  }

 private:
  static bool has(const std::shared_ptr<const MessageType>& type, const std::string& field) {
    try {
      MessageReader(type, {.fields = {field}, .clock = {}});
    } catch (const Error&) {
      return false;
    }
    return true;
  }
  struct Form {
    std::unique_ptr<MessageReader> reader = {};
    std::vector<std::size_t> slots = {};  ///< of its fields, among those that are asked for
    std::vector<double> values = {};
  };
  std::size_t fields_;
  std::vector<Form> forms_;
};

}  // namespace

std::unique_ptr<FieldReader> MessageLog::reader(int topic, const FieldRequest& request) const {
  std::vector<std::shared_ptr<const MessageType>> types;
  for (std::size_t form = 0; form < forms_[static_cast<std::size_t>(topic)].size(); ++form)
    types.push_back(type_of(topic, static_cast<int>(form)));
  try {
    if (types.size() == 1) return std::make_unique<MessageReader>(types.front(), request);
    return std::make_unique<FormReader>(types, request);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: topic {}: {}", name(), topics_[static_cast<std::size_t>(topic)].name, error.what()));
  }
}

std::vector<std::string> MessageLog::fields_of(const Record& record) const {
  return number_paths(*type_of(record.topic, record.form), record.bytes);
}

}  // namespace rhec::logs
