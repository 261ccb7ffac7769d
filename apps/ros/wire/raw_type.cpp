#include "raw_type.hpp"

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <dds/ddsi/q_radmin.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <new>
#include <vector>

namespace rhec::apps::ros {
namespace {

/// A message: its bytes, filled up to a multiple of four, as they are sent.
struct Message : ddsi_serdata {
  std::vector<std::byte> bytes;
  std::size_t size = 0;
  Clock::time_point received = Clock::now();
};

const Message& as_message(const ddsi_serdata* data) { return *static_cast<const Message*>(data); }

/// Exceptions do not cross C: without memory there is no message, and Cyclone drops it.
Message* make_message(const ddsi_sertype* type, ddsi_serdata_kind kind, std::size_t size) noexcept {
  try {
    auto message = std::make_unique<Message>();
    ddsi_serdata_init(message.get(), type, kind);
    message->size = size;
    message->bytes.resize((size + 3) / 4 * 4);
    return message.release();
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}

bool same_key(const ddsi_serdata*, const ddsi_serdata*) { return true; }  // no message has a key

std::uint32_t size_of(const ddsi_serdata* data) { return static_cast<std::uint32_t>(as_message(data).size); }

ddsi_serdata* from_fragments(const ddsi_sertype* type, ddsi_serdata_kind kind, const nn_rdata* fragment, size_t size) {
  if (kind != SDK_DATA || size > most_message_bytes) return make_message(type, kind, 0);
  Message* const message = make_message(type, kind, size);
  if (!message) return nullptr;
  std::size_t known = 0;  // fragments may overlap
  for (; fragment && known < size; fragment = fragment->nextfrag) {
    const std::size_t end = std::min<std::size_t>(fragment->maxp1, size);
    if (fragment->min > known || end <= known) continue;
    const unsigned char* const payload = NN_RMSG_PAYLOADOFF(fragment->rmsg, NN_RDATA_PAYLOAD_OFF(fragment));
    std::memcpy(message->bytes.data() + known, payload + (known - fragment->min), end - known);
    known = end;
  }
  return message;
}

ddsi_serdata* from_pieces(const ddsi_sertype* type, ddsi_serdata_kind kind, ddsrt_msg_iovlen_t count,
                          const ddsrt_iovec_t* pieces, size_t size) {
  if (kind != SDK_DATA || size > most_message_bytes) return make_message(type, kind, 0);
  Message* const message = make_message(type, kind, size);
  if (!message) return nullptr;
  std::size_t known = 0;
  for (ddsrt_msg_iovlen_t i = 0; i < count && known < size; ++i) {
    const std::size_t length = std::min<std::size_t>(pieces[i].iov_len, size - known);
    std::memcpy(message->bytes.data() + known, pieces[i].iov_base, length);
    known += length;
  }
  return message;
}

ddsi_serdata* from_key(const ddsi_sertype* type, const ddsi_keyhash*) { return make_message(type, SDK_KEY, 0); }

ddsi_serdata* from_sample(const ddsi_sertype*, ddsi_serdata_kind, const void*) { return nullptr; }

void copy_bytes(const ddsi_serdata* data, size_t offset, size_t count, void* into) {
  std::memcpy(into, as_message(data).bytes.data() + offset, count);
}

ddsi_serdata* borrow_bytes(const ddsi_serdata* data, size_t offset, size_t count, ddsrt_iovec_t* into) {
  into->iov_base = const_cast<std::byte*>(as_message(data).bytes.data() + offset);
  into->iov_len = static_cast<ddsrt_iov_len_t>(count);
  return ddsi_serdata_ref(data);
}

void return_bytes(ddsi_serdata* data, const ddsrt_iovec_t*) { ddsi_serdata_unref(data); }

bool to_sample(const ddsi_serdata*, void*, void**, void*) { return false; }

ddsi_serdata* to_untyped(const ddsi_serdata* data) { return make_message(data->type, SDK_KEY, 0); }

bool untyped_to_sample(const ddsi_sertype*, const ddsi_serdata*, void*, void**, void*) { return false; }

void free_message(ddsi_serdata* data) { delete static_cast<Message*>(data); }

size_t print(const ddsi_sertype* type, const ddsi_serdata* data, char* text, size_t size) {
  return static_cast<size_t>(
      std::snprintf(text, size, "%s, %zu bytes", type->type_name, static_cast<size_t>(as_message(data).size)));
}

void write_key(const ddsi_serdata*, ddsi_keyhash* key, bool) { std::memset(key, 0, sizeof(*key)); }

constexpr ddsi_serdata_ops make_message_functions() {
  ddsi_serdata_ops functions{};
  functions.eqkey = same_key;
  functions.get_size = size_of;
  functions.from_ser = from_fragments;
  functions.from_ser_iov = from_pieces;
  functions.from_keyhash = from_key;
  functions.from_sample = from_sample;
  functions.to_ser = copy_bytes;
  functions.to_ser_ref = borrow_bytes;
  functions.to_ser_unref = return_bytes;
  functions.to_sample = to_sample;
  functions.to_untyped = to_untyped;
  functions.untyped_to_sample = untyped_to_sample;
  functions.free = free_message;
  functions.print = print;
  functions.get_keyhash = write_key;
  return functions;
}
constexpr ddsi_serdata_ops message_functions = make_message_functions();

void free_type(ddsi_sertype* type) {
  ddsi_sertype_fini(type);
  delete type;
}
// Samples of the application's own form do not exist.
void zero_samples(const ddsi_sertype*, void*, size_t) {}
void realloc_samples(void** samples, const ddsi_sertype*, void*, size_t, size_t count) {
  std::fill_n(samples, count, nullptr);
}
void free_samples(const ddsi_sertype*, void**, size_t, dds_free_op_t) {}
bool same_type(const ddsi_sertype*, const ddsi_sertype*) { return true; }  // names are compared before
std::uint32_t hash_type(const ddsi_sertype*) { return 0; }

ddsi_sertype_ops make_type_functions() {
  ddsi_sertype_ops functions{};
  functions.version = ddsi_sertype_v0;
  functions.free = free_type;
  functions.zero_samples = zero_samples;
  functions.realloc_samples = realloc_samples;
  functions.free_samples = free_samples;
  functions.equal = same_type;
  functions.hash = hash_type;
  return functions;
}

}  // namespace

ddsi_sertype* make_raw_type(const std::string& name) {
  static const ddsi_sertype_ops type_functions = make_type_functions();
  auto type = std::make_unique<ddsi_sertype>();
  ddsi_sertype_init(type.get(), name.c_str(), &type_functions, &message_functions, true);
  type->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
  return type.release();
}

ddsi_serdata* make_raw_message(const ddsi_sertype* type, std::span<const std::byte> cdr) {
  Message* const message = make_message(type, SDK_DATA, cdr.size());
  if (!message) throw std::bad_alloc();
  std::ranges::copy(cdr, message->bytes.begin());
  return message;
}

RawMessage look_into(const ddsi_serdata* data) {
  const Message& message = as_message(data);
  return {std::span(message.bytes).first(message.size), message.received};
}

void MessageRelease::operator()(ddsi_serdata* message) const noexcept { ddsi_serdata_unref(message); }

}  // namespace rhec::apps::ros
