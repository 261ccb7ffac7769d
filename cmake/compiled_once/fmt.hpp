#pragma once

// What fmt would compile anew for every source that formats into a text that it has, or joins texts: the formatting of
// every type of number. As eigen.hpp.

#include <fmt/format.h>

#include <string>
#include <type_traits>
#include <vector>

// What is named below is inside fmt 9; with another version each source has its own.
#if FMT_VERSION >= 90000 && FMT_VERSION < 100000

#ifndef RHEC_COMPILED_ONCE  // fmt.cpp defines it as nothing
#define RHEC_COMPILED_ONCE extern
#endif

FMT_BEGIN_NAMESPACE
namespace detail {

RHEC_COMPILED_ONCE template void vformat_to(buffer<char>&, basic_string_view<char>, basic_format_args<format_context>,
                                            locale_ref);
RHEC_COMPILED_ONCE template appender write_escaped_string(appender, basic_string_view<char>);
RHEC_COMPILED_ONCE template counting_iterator write_escaped_string(counting_iterator, basic_string_view<char>);

// fmt::join of texts, and of whole numbers.
template <class Container, bool is_const>
using Iterator = std::conditional_t<is_const, typename Container::const_iterator, typename Container::iterator>;
template <class Entry, bool is_const>
using Joined = join_view<Iterator<std::vector<Entry>, is_const>, Iterator<std::vector<Entry>, is_const>, char>;

RHEC_COMPILED_ONCE template void value<format_context>::format_custom_arg<
    Joined<std::string, false>, formatter<Joined<std::string, false>>>(void*, format_parse_context&, format_context&);
RHEC_COMPILED_ONCE template void value<format_context>::format_custom_arg<
    Joined<std::string, true>, formatter<Joined<std::string, true>>>(void*, format_parse_context&, format_context&);
RHEC_COMPILED_ONCE template void
value<format_context>::format_custom_arg<Joined<int, true>, formatter<Joined<int, true>>>(void*, format_parse_context&,
                                                                                          format_context&);

}  // namespace detail
FMT_END_NAMESPACE

#endif
