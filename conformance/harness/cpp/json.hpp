// JSON for adapter.hpp, as little as it needs: parse a line, look into it. To use another library, give it this
// interface: json::parse(text) -> json::Value, and on Value: is_number, is_object, number, text, items, at(name).
#pragma once
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace json {

struct Error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

struct Value {
    enum Kind { NOTHING, BOOLEAN, NUMBER, TEXT, LIST, OBJECT } kind = NOTHING;
    double number = 0;
    bool is_integer = false;
    std::string text;
    std::vector<Value> items;
    std::map<std::string, Value> fields;

    bool is_null() const { return kind == NOTHING; }
    bool is_number() const { return kind == NUMBER; }
    bool is_text() const { return kind == TEXT; }
    bool is_list() const { return kind == LIST; }
    bool is_object() const { return kind == OBJECT; }
    bool has(const std::string& name) const { return fields.count(name) > 0; }
    // A field; null where there is none.
    const Value& at(const std::string& name) const {
        static const Value none;
        auto found = fields.find(name);
        return found == fields.end() ? none : found->second;
    }
};

class Parser {
  public:
    explicit Parser(const std::string& line) : text(line) {}
    Value whole() {
        Value found = value(0);
        skip();
        if (i != text.size()) fail();
        return found;
    }

  private:
    enum { DEEPEST = 64 };
    const std::string& text;
    size_t i = 0;

    [[noreturn]] void fail() const { throw Error("no JSON at byte " + std::to_string(i)); }
    char peek() const { return i < text.size() ? text[i] : '\0'; }
    void skip() {
        while (i < text.size() && std::string(" \t\r\n").find(text[i]) != std::string::npos) i++;
    }
    bool take(char c) {
        skip();
        if (peek() != c) return false;
        return i++, true;
    }
    void need(char c) {
        if (!take(c)) fail();
    }
    Value word(const char* expected, Value found) {
        for (const char* c = expected; *c; c++, i++)
            if (peek() != *c) fail();
        return found;
    }

    Value value(int depth) {
        if (depth > DEEPEST) fail();
        Value found;
        skip();
        switch (peek()) {
        case '{': return object(depth);
        case '[':
            i++, found.kind = Value::LIST;
            if (take(']')) return found;
            do found.items.push_back(value(depth + 1));
            while (take(','));
            need(']');
            return found;
        case '"': return found.kind = Value::TEXT, found.text = quoted(), found;
        case 't': return found.kind = Value::BOOLEAN, found.number = 1, word("true", found);
        case 'f': return found.kind = Value::BOOLEAN, word("false", found);
        case 'n': return word("null", found);
        default: return numeral();
        }
    }

    Value object(int depth) {
        Value found;
        i++, found.kind = Value::OBJECT;
        if (take('}')) return found;
        do {
            skip();
            if (peek() != '"') fail();
            std::string name = quoted();
            need(':');
            found.fields[name] = value(depth + 1);
        } while (take(','));
        need('}');
        return found;
    }

    size_t digits() {
        size_t begin = i;
        while (peek() >= '0' && peek() <= '9') i++;
        if (i == begin) fail();
        return i - begin;
    }
    Value numeral() {
        Value found;
        size_t begin = i;
        found.kind = Value::NUMBER, found.is_integer = true;
        if (peek() == '-') i++;
        bool is_zero = peek() == '0';
        if (digits() > 1 && is_zero) fail();
        if (peek() == '.') i++, digits(), found.is_integer = false;
        if (peek() == 'e' || peek() == 'E') {
            i++, found.is_integer = false;
            if (peek() == '+' || peek() == '-') i++;
            digits();
        }
        found.number = std::strtod(text.substr(begin, i - begin).c_str(), nullptr);
        if (!std::isfinite(found.number)) throw Error("a number is out of range");
        return found;
    }

    std::string quoted() {
        std::string found;
        for (i++; peek() != '"'; i++) {
            if (i >= text.size() || static_cast<unsigned char>(peek()) < 0x20) fail();
            if (peek() != '\\') {
                found += peek();
                continue;
            }
            i++;
            size_t at = std::string("\"\\/bfnrt").find(peek());
            if (i < text.size() && at != std::string::npos) found += "\"\\/\b\f\n\r\t"[at];
            else if (peek() == 'u') unicode(found);
            else fail();
        }
        return i++, found;
    }
    void unicode(std::string& out) {  // surrogates stay as they are: nothing here looks at such text
        if (i + 4 >= text.size()) fail();
        char* end = nullptr;
        std::string four = text.substr(i + 1, 4);
        unsigned long code = std::strtoul(four.c_str(), &end, 16);
        if (*end || four.find_first_of("+- xX") != std::string::npos) fail();
        i += 4;
        if (code < 0x80) out += static_cast<char>(code);
        else if (code < 0x800) out += static_cast<char>(0xC0 | code >> 6), out += static_cast<char>(0x80 | (code & 63));
        else {
            out += static_cast<char>(0xE0 | code >> 12), out += static_cast<char>(0x80 | (code >> 6 & 63));
            out += static_cast<char>(0x80 | (code & 63));
        }
    }
};

inline Value parse(const std::string& line) { return Parser(line).whole(); }

}  // namespace json
