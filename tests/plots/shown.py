"""What a picture shows."""


def lines(ax) -> dict:
    """Lines by their labels."""
    return {line.get_label(): line for line in ax.lines}


def words(texts) -> set[str]:
    """What texts say."""
    return {t.get_text() for t in texts}


def legend(ax) -> set[str]:
    """Labels of the legend."""
    return words(ax.get_legend().get_texts())
