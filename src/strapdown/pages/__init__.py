"""Figures of solutions as functions, and the page that shows them:
`strapdown.report(solution).save("report.html")`."""
