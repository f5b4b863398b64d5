// SPDX-License-Identifier: GPL-3.0-or-later
/// Walks through a text in memory token by token and line by line; strict numbers.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

namespace interglow::mesh::detail {

/// The whole token as a number ("+1.5", "2.", "1e3", "nan", "inf"), or nothing: "1,5", "1.5x" and "" are no numbers.
/// Too large a number is infinite, too small a one 0.
std::optional<double> parse_number(std::string_view token);

/// The whole token as a decimal integer; out of range of long long counts as its largest value.
std::optional<long long> parse_integer(std::string_view token);

class TextCursor {
 public:
  struct Syntax {
    bool comments = false;       ///< '#' ends the line
    bool continuations = false;  ///< '\' before the end of a line joins the next one
  };
  TextCursor(std::string_view text, Syntax syntax, std::size_t first_line = 1)
      : next_(text.data()),
        end_(text.data() + text.size()),
        line_(first_line),
        // Old Macintosh files have carriage returns alone.
        newline_(text.find('\n') == std::string_view::npos && text.find('\r') != std::string_view::npos ? '\r' : '\n'),
        syntax_(syntax) {}

  std::size_t line() const { return line_; }
  bool at_end() const { return next_ == end_; }
  std::size_t bytes_left() const { return static_cast<std::size_t>(end_ - next_); }
  /// True if the line that the cursor is on has no newline: the last one, perhaps cut off.
  bool on_unfinished_line() const {
    return std::string_view(next_, bytes_left()).find(newline_) == std::string_view::npos;
  }

  /// The next token of this line; empty at its end.
  std::string_view token() {
    skip_blanks();
    const char* begin = next_;
    while (next_ != end_ && !is_blank(*next_) && *next_ != newline_ && !at_continuation()) ++next_;
    return {begin, static_cast<std::size_t>(next_ - begin)};
  }

  /// The next token, on this line or a later one; empty at the end of the text.
  std::string_view token_across_lines() {
    for (;;) {
      const std::string_view found = token();
      if (!found.empty() || at_end()) return found;
      next_line();
    }
  }

  /// Goes to the beginning of the next line.
  void next_line() {
    while (next_ != end_ && *next_ != newline_) ++next_;
    if (next_ != end_) {
      ++next_;
      ++line_;
    }
  }

 private:
  bool is_blank(char c) const {
    return c == ' ' || c == '\t' || (c == '\r' && newline_ != '\r') || c == '\v' || c == '\f';
  }
  bool at_continuation() const {
    if (!syntax_.continuations || *next_ != '\\') return false;
    const char* after = next_ + 1;
    if (after != end_ && *after == '\r' && newline_ != '\r') ++after;
    return after == end_ || *after == newline_;
  }
  void skip_blanks() {
    while (next_ != end_) {
      if (is_blank(*next_)) {
        ++next_;
      } else if (syntax_.comments && *next_ == '#') {
        while (next_ != end_ && *next_ != newline_) ++next_;
        return;
      } else if (at_continuation()) {
        next_line();
      } else {
        return;
      }
    }
  }

  const char* next_;
  const char* end_;
  std::size_t line_;
  char newline_;
  Syntax syntax_;
};

}  // namespace interglow::mesh::detail
