"""Typesets a law: MathML from a formula as the laws write it in one line, `F = -c (g/h)^3 zeta'`.

Greek letters by name, ^ and _ as in TeX, a/b as a fraction, ' as a time derivative, |x|, sums and products as written;
words that are no function, as "within", stay words.
"""

from __future__ import annotations

import html
import re

GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "zeta": "ζ", "phi": "φ", "Phi": "Φ", "rho": "ρ", "tau": "τ", "mu": "μ",
    "omega": "ω", "theta": "θ", "pi": "π", "eta": "η", "sigma": "σ", "kappa": "κ", "lambda": "λ", "nu": "ν",
}  # fmt: skip
FUNCTIONS = {"exp", "tanh", "sign", "max", "min", "sin", "cos", "log", "ln", "late", "mod"}
TOKENS = re.compile(
    r"\s+|(?P<number>\d+(?:\.\d+)?(?:e[+-]?\d+)?)|(?P<name>[A-Za-zα-ωΑ-Ω]\w*)|(?P<unit>\[[^\]]*\])|(?P<other>->|.)"
)
#: Longest name that is a symbol by itself; longer ones are words.
SYMBOL = 2
SIGNS = {"-": "−", "*": "·", "->": "→"}
NUMBER = re.compile(r"(\d(?:\.\d+)?)e([+-]?\d+)")
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
    return " ".join(f'<math display="inline">{_Reader(one).row()}</math>' for one in clauses if one.strip())


class _Reader:
    """Reads tokens from the left; what it cannot make sense of is shown as it stands."""

    def __init__(self, text: str) -> None:
        found = [(m.lastgroup, m[0]) for m in TOKENS.finditer(text) if m.lastgroup]
        self.tokens: list[Token] = [(str(kind), word) for kind, word in found]
        self.at, self.bars = 0, 0

    def row(self, ends: str = "") -> str:
        """Everything up to one of ``ends``, which is left to the caller."""
        out: list[str] = []
        while (token := self._next()) is not None and not (ends and token[1] in ends):
            self.at += 1
            if token[1] == "/" and out:
                out.append(f"<mfrac>{out.pop()}{self.factor()}</mfrac>")
            else:
                self.at -= 1
                out.append(self.factor())
        return "".join(out)

    def factor(self) -> str:
        """One symbol, number or bracket with what hangs on it."""
        one = self._atom()
        while (token := self._next()) is not None and token[1] in ("^", "'"):
            self.at += 1
            if token[1] == "'":
                one = f'<msup>{one}<mo>′</mo></msup>'
            else:
                one = f"<msup>{one}{self._power()}</msup>"
        return one

    def _power(self) -> str:
        if (token := self._next()) is not None and token[1] == "-":
            self.at += 1
            return f"<mrow><mo>−</mo>{self._atom()}</mrow>"
        return self._atom()

    def _atom(self) -> str:
        token = self._next()
        if token is None:
            return "<mrow></mrow>"
        self.at += 1
        kind, word = token
        if kind == "number":
            return _number(word)
        if kind == "name":
            return self._name(word)
        if kind == "unit":
            return f"<mrow><mo>[</mo>{_Reader(word[1:-1]).row()}<mo>]</mo></mrow>"
        if word == "(":
            inside = self.row(")")
            self._skip()
            return f"<mrow><mo>(</mo>{inside}<mo>)</mo></mrow>"
        if word == "|":
            inside = self.row("|")
            self._skip()
            return f"<mrow><mo>|</mo>{inside}<mo>|</mo></mrow>"
        return f"<mo>{html.escape(SIGNS.get(word, word))}</mo>"

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
        if head not in GREEK and len(re.sub(r"\d+$", "", head)) > SYMBOL:
            return f"<mtext>&nbsp;{html.escape(word.replace('_', ' '))}&nbsp;</mtext>"
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


def _number(word: str) -> str:
    found = NUMBER.fullmatch(word)
    if not found:
        return f"<mn>{word}</mn>"
    power = f"<msup><mn>10</mn><mn>{str(int(found[2])).replace('-', '−')}</mn></msup>"
    return f"<mrow><mn>{found[1]}</mn><mo>·</mo>{power}</mrow>"
