#include "svg_engine.hpp"

#include <duktape.h>
#include <fmt/format.h>

#include <memory>

#include "embedded.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::apps {

namespace {

struct DestroyHeap {
  void operator()(duk_context* context) const { duk_destroy_heap(context); }
};

/// Called for errors outside of protected calls. Below, only pushing strings is unprotected, so memory has run out.
[[noreturn]] void on_fatal(void*, const char* message) {
  throw Error(fmt::format("rhec report: the script of the figures failed: {}", message ? message : "no reason given"));
}

[[noreturn]] void refuse(duk_context* context) {
  throw Error(fmt::format("rhec report: the figures cannot be drawn: {}", duk_safe_to_stacktrace(context, -1)));
}

}  // namespace

std::string draw_figures(const std::string& document) {
  const std::unique_ptr<duk_context, DestroyHeap> heap(duk_create_heap(nullptr, nullptr, nullptr, nullptr, on_fatal));
  if (!heap) throw Error("rhec report: no memory for the script of the figures");
  duk_context* context = heap.get();
  const std::string_view script = embedded_figures();
  if (duk_peval_lstring_noresult(context, script.data(), script.size()) != 0) refuse(context);
  duk_get_global_string(context, "drawFigures");
  duk_push_lstring(context, document.data(), document.size());
  if (duk_pcall(context, 1) != DUK_EXEC_SUCCESS) refuse(context);
  duk_size_t size = 0;
  const char* text = duk_require_lstring(context, -1, &size);
  return {text, size};
}

}  // namespace rhec::apps
