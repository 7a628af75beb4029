"""Typesets a law: MathML from the laws' one-line notation, `F = -c (g/h)^3 zeta'`.

Greek letters by name, ^ and _ as in TeX, a/b as a fraction, ' as a time derivative, |x|, sums and products as written;
words other than functions, as "within", stay words.
"""

from __future__ import annotations

import html
import re
import unicodedata

from straw.replay.diagnose.page.words import raised

LETTERS = "alpha beta gamma delta zeta eta theta kappa lamda mu nu xi pi rho sigma tau phi chi psi omega"
GREEK = {name: unicodedata.lookup(f"GREEK SMALL LETTER {name}") for name in LETTERS.split()}
GREEK |= {"lambda": GREEK["lamda"], "Phi": unicodedata.lookup("GREEK CAPITAL LETTER PHI")}
MINUS, PRIME, D = "&#x2212;", "&#x2032;", "<mi mathvariant='normal'>d</mi>"
FUNCTIONS = {"exp", "tanh", "sign", "max", "min", "sin", "cos", "log", "ln", "late", "played", "mod"}
TOKENS = re.compile(
    r"\s+|(?P<number>\d+(?:\.\d+)?(?:e[+-]?\d+)?)|(?P<name>[^\W\d]\w*(?:'s\b)?)|(?P<unit>\[[^\]]*\])|(?P<other>->|\.\.\.|.)"
)
#: Units that may follow a number; a symbol of the same name stands elsewhere.
UNITS = {"m", "mm", "s", "ms", "N", "Pa", "kPa", "rad", "mrad", "V", "A", "kg", "K", "Hz", "J", "W", "bar", "mbar"}
#: Longest name that is a symbol by itself; longer ones are words.
SYMBOL = 2
#: Words as short.
SHORT = {"of", "at", "by", "in", "is", "or", "to", "as", "on"}
SIGNS = {"-": MINUS, "*": "·", "->": "→", "...": "…"}
NUMBER = re.compile(r"(\d(?:\.\d+)?)e([+-]?\d+)")
OPEN, CLOSE = "<mrow><mo>(</mo>", "<mo>)</mo></mrow>"
#: Around what is no taller than a line, as some fonts stretch brackets beyond it.
LOW_OPEN, LOW_CLOSE = (one.replace("<mo>", '<mo stretchy="false">') for one in (OPEN, CLOSE))
Token = tuple[str, str]


def mathml(formula: str) -> str:
    """A formula, or several with commas between them, as one MathML element each, which may break between them."""
    clauses, depth, last = [], 0, 0
    for k, c in enumerate(formula):
        depth += (c in "([") - (c in ")]")
        if depth == 0 and c in ",;" and formula[k + 1 : k + 2] == " ":
            clauses.append(formula[last:k])
            last = k + 2
    clauses.append(formula[last:])
    return " ".join(
        f'<math display="inline"><mstyle displaystyle="true">{_Reader(one).row()}</mstyle></math>'
        for one in clauses
        if one.strip()
    )


def _is_word(token: Token) -> bool:
    """Whether a token is a word, no symbol and no function."""
    kind, word = token
    return kind == "name" and len(word) > SYMBOL and word not in FUNCTIONS and word not in GREEK and "_" not in word


class _Reader:
    """Parses tokens from the left; what it cannot parse is shown as it stands."""

    def __init__(self, text: str) -> None:
        found = [(m.lastgroup, m[0]) for m in TOKENS.finditer(text) if m.lastgroup]
        self.tokens: list[Token] = [(str(kind), word) for kind, word in found]
        self.at = 0

    def row(self, ends: str = "") -> str:
        """Everything up to one of ``ends``, which is left to the caller."""
        out: list[str] = []
        while (token := self._next()) is not None and not (ends and token[1] in ends):
            self.at += 1
            if token[1] == "/" and out:
                out.append(f"<mfrac>{_bare(out.pop())}{_bare(self.factor(plain=True))}</mfrac>")
            else:
                self.at -= 1
                out.append(self.factor())
        return "".join(out)

    def factor(self, *, plain: bool = False) -> str:
        """One symbol, number or bracket with its attachments; ``plain``: a number in a denominator has no unit."""
        one = self._rate() or self._atom(plain)
        while (token := self._next()) is not None and token[1] in ("^", "'"):
            self.at += 1
            above = f"<mo>{PRIME}</mo>" if token[1] == "'" else self._power()
            one = f"<msup>{one}{above}</msup>"
        return one

    def _rate(self) -> str:
        """d x/dt; empty for anything else."""
        words = [word for _, word in self.tokens[self.at : self.at + 4]]
        if len(words) < 4 or (words[0], *words[2:]) != ("d", "/", "dt"):
            return ""
        self.at += 1
        name = self._atom()
        self.at += 2
        return f"<mfrac><mrow>{D}{name}</mrow><mrow>{D}<mi>t</mi></mrow></mfrac>"

    def _power(self) -> str:
        if (token := self._next()) is not None and token[1] == "-":
            self.at += 1
            return f"<mrow><mo>{MINUS}</mo>{self._atom()}</mrow>"
        return self._atom()

    def _atom(self, plain: bool = False) -> str:
        token = self._next()
        if token is None:
            return "<mrow></mrow>"
        self.at += 1
        kind, word = token
        if kind == "number":
            return _number(word) if plain else f"<mrow>{_number(word)}{self._unit()}</mrow>"
        if kind == "name":
            return self._name(word)
        if kind == "unit":
            return f"<mrow><mo>[</mo>{_Reader(word[1:-1]).row()}<mo>]</mo></mrow>"
        if word == "(":
            inside = self.row(")")
            self._skip()
            tall = "<mfrac>" in inside or "<msup>" in inside or "<msqrt>" in inside
            return f"{OPEN}{inside}{CLOSE}" if tall else f"{LOW_OPEN}{inside}{LOW_CLOSE}"
        if word == "|":
            inside = self.row("|")
            self._skip()
            return f"<mrow><mo>|</mo>{inside}<mo>|</mo></mrow>"
        return f"<mo>{SIGNS.get(word) or html.escape(word)}</mo>"

    def _unit(self) -> str:
        """The unit after a number, if any."""
        found: list[str] = []
        while (token := self._next()) is not None and (token[1] in UNITS or (found and token[1] in "/^()2345")):
            if token[1] == ")" and "(" not in found:
                break
            found.append(token[1])
            self.at += 1
        return f"<mtext>&#8239;{html.escape(raised(''.join(_spaced(found))))}</mtext>" if found else ""

    def _name(self, word: str) -> str:
        if word == "sqrt" and (token := self._next()) is not None and token[1] == "(":
            self.at += 1
            inside = self.row(")")
            self._skip()
            return f"<msqrt>{inside}</msqrt>"
        if word in FUNCTIONS:
            return f"<mi mathvariant='normal'>{word}</mi><mo>&#x2061;</mo>"
        head, _, tail = word.partition("_")
        symbol = GREEK.get(head, head)
        article = word == "a" and (after := self._next()) is not None and _is_word(after)
        if article or word in SHORT or (head not in GREEK and len(re.sub(r"\d+$", "", head)) > SYMBOL):
            return f"<mtext>&#160;{html.escape(word.replace('_', ' '))}&#160;</mtext>"
        digits = re.fullmatch(r"(\D+)(\d+)", symbol)
        if digits and not tail:
            symbol, tail = digits.groups()
        if not tail:
            return f"<mi>{symbol}</mi>"
        low = GREEK.get(tail, tail)
        below = f"<mn>{low}</mn>" if low.isdigit() else f"<mi mathvariant='normal'>{low}</mi>"
        return f"<msub><mi>{symbol}</mi>{below}</msub>"

    def _next(self) -> Token | None:
        return self.tokens[self.at] if self.at < len(self.tokens) else None

    def _skip(self) -> None:
        self.at += 1


def _spaced(words: list[str]) -> list[str]:
    """Units side by side with a space between them: N s/m."""
    return [f" {word}" if k and word in UNITS and words[k - 1] in UNITS else word for k, word in enumerate(words)]


def _bare(one: str) -> str:
    """Without brackets in a numerator or denominator."""
    for first, last in ((OPEN, CLOSE), (LOW_OPEN, LOW_CLOSE)):
        if one.startswith(first) and one.endswith(last):
            return f"<mrow>{one[len(first) : -len(last)]}</mrow>"
    return one


def _number(word: str) -> str:
    found = NUMBER.fullmatch(word)
    if not found:
        return f"<mn>{word}</mn>"
    power = f"<msup><mn>10</mn><mn>{str(int(found[2])).replace('-', MINUS)}</mn></msup>"
    return f"<mrow><mn>{found[1]}</mn><mo>·</mo>{power}</mrow>"
